"""What requests take and answers have, as types: written by ``python -m app.api.published``.

Answers and requests are plain dictionaries and lists. Of a later service they may have more members. Final
types let a type checker tell stops apart by ``"target_id" in stop``.
"""

from __future__ import annotations

from typing import Any, Literal, NotRequired, TypedDict, final

AlgorithmName = Literal[
    "transfer_qmix",
    "qmix",
    "dqn",
    "ga",
    "local_search",
    "auto",
    "exact",
    "greedy",
    "particle_swarm",
    "grey_wolf",
    "beetle_antennae",
    "ant_colony",
    "contract_net",
    "bundles",
    "semi_random_q",
]


@final
class AlgorithmList(TypedDict):
    """The algorithms."""

    algorithms: list[Algorithm]
    """All of them."""


@final
class Algorithm(TypedDict):
    """One algorithm."""

    name: str
    """As `algorithm` in `POST /allocate`."""

    summary: str
    """What it does."""

    learns: bool
    """Whether the library can hold what it learns."""

    comparison: bool
    """Whether it is there to be compared with: its plans may earn less than the greedy rule's."""

    unsupported: list[Unsupported]
    """Fields of a problem that it refuses with 422; it takes all others."""

    parameters: dict[str, Any]
    """JSON schema of its parameters."""

    defaults: dict[str, Any]
    """Its parameters where none are given."""


@final
class Allocation(TypedDict):
    """A plan, what it earns, and how it was found."""

    job_id: str
    """The job that found it, see `GET /jobs/{job_id}`."""

    algorithm: str
    """The algorithm that was asked for."""

    answered_by: NotRequired[str | None]
    """The algorithm whose plan it is: `greedy` where no time was left for another; null in answers of
    versions that did not say so."""

    parameters: dict[str, Any]
    """The parameters of the algorithm that was asked for, defaults filled in."""

    seed: int
    """The seed that was used."""

    assignment: list[list[int]]
    """One joint action a step: for each UAV the index of its target, N for home, or N + 1 + d to reload at
    base d."""

    reward: float
    """satisfaction - distance_weight · distance - makespan_weight · makespan - change_weight · changes."""

    satisfaction: float
    """Sum over the visits of level · delivered / requested."""

    distance: float
    """Total distance, legs home only if they are charged."""

    distance_weight: float
    """λ as it was used."""

    bound: NotRequired[float | None]
    """No plan earns more, whichever way it unloads; null unless `bound` was asked for."""

    gap: NotRequired[float | None]
    """(bound - reward) / bound: the share by which the plan may fall short of the best; null without a
    bound, or where the bound is not positive."""

    proof: NotRequired[Proof | None]
    """Of `exact`: whether the plan is proven to be the best, where it unloads greedily."""

    routes: list[Route]
    """One a UAV."""

    unmet: list[Unmet]
    """Areas with needs left, each with the reason."""

    reasons: NotRequired[Literal["complete", "pending", "incomplete"]]
    """Whether the reasons of `unmet` are all there: `pending` where the time limit left none to look for
    them, then the result of `GET /jobs/{job_id}` has them soon after; `incomplete` where they will not
    come."""

    warnings: NotRequired[list[WarningModel]]
    """What in the problem was probably not meant; nothing is refused for it."""

    source_policy: SourcePolicy | None
    """What was transferred, if anything."""

    history: HistoryModel
    """Reward against epoch; thinned evenly beyond 10,000."""

    makespan: NotRequired[float | None]
    """When the last UAV with a visit has landed; 0 without visits. Only where the problem uses fields of
    the world."""

    changes: NotRequired[int | None]
    """Pairs of UAV and area that are visited in `start_plan` and not in the plan. Only where the problem
    uses fields of the world."""

    bases: NotRequired[list[BaseLeft] | None]
    """What is left of each stock. Only where the problem has bases."""

    elapsed_s: float
    """Seconds from the request's arrival to the plan."""


@final
class AllocationRequest(TypedDict):
    """A problem, and how to solve it."""

    uavs: list[UAV]
    """The swarm."""

    targets: list[Target]
    """The rescue areas."""

    max_steps: NotRequired[int]
    """Most decision steps of a plan, S."""

    crs: NotRequired[Literal["local", "wgs84"]]
    """local: x, y on a plane, Euclidean distances. wgs84: x longitude and y latitude in degrees, great
    circles in km, speeds in km/h, times in h."""

    objective: NotRequired[Objective]
    """What a plan is paid for."""

    materials: NotRequired[list[Material]]
    """The kinds of material, in the order of every `loadlist`; default: material-1, … of weight 1."""

    bases: NotRequired[list[Base]]
    """Where UAVs land, reload and take off again; at the end each lands at the nearest, or where it began.
"""

    no_fly_zones: NotRequired[list[NoFlyZone]]
    """What must not be flown through."""

    wind: NotRequired[Wind | None]
    """Wind; default: still air."""

    matrices: NotRequired[dict[str, Matrix] | None]
    """Legs by the names of profiles, in place of distances between positions; then coordinates are for
    display alone."""

    start_plan: NotRequired[list[list[int]] | None]
    """An `assignment` to begin from and to compare with; no answer that takes a start earns less."""

    algorithm: NotRequired[AlgorithmName]
    """See `GET /algorithms`."""

    parameters: NotRequired[dict[str, Any]]
    """The algorithm's own; the others keep their defaults."""

    seed: NotRequired[int]
    """Source of all randomness: same request, same seed, no time limit: same answer."""

    time_limit_s: NotRequired[float | None]
    """The answer comes within this time, with the best plan so far; null: no limit."""

    keep_checkpoint: NotRequired[bool]
    """Whether what an algorithm learns is kept with the job, so that `POST /library` can register it by its
    `job_id`; half a megabyte and more."""

    bound: NotRequired[bool]
    """Whether the answer has an upper bound on the reward of any plan."""

    bound_time_limit_s: NotRequired[float]
    """Seconds to look for the bound, after the plan was found; within `time_limit_s`, of which at most a
    third is kept for it."""


AltitudeBy = Literal["uav", "leg"]
"""What has an altitude of its own."""


AltitudeReference = Literal["home", "terrain"]
"""What altitudes are measured from."""


@final
class AreaCancelledEvent(TypedDict):
    """A rescue area needs nothing any more."""

    target_id: str
    """The rescue area."""

    type: Literal["area_cancelled"]
    """What has happened."""

    id: str
    """A name of your own for this event; told again with it, it is not a second one."""

    at: NotRequired[float | None]
    """When it became known, by the mission's clock, and not before that; default: at that clock, or when a
    UAV was seen last."""


@final
class AreasAddedEvent(TypedDict):
    """Rescue areas are there that were not known; each with an id that is new."""

    targets: list[Target]
    """The areas."""

    type: Literal["areas_added"]
    """What has happened."""

    id: str
    """A name of your own for this event; told again with it, it is not a second one."""

    at: NotRequired[float | None]
    """When it became known, by the mission's clock, and not before that; default: at that clock, or when a
    UAV was seen last."""


@final
class AreasChangedEvent(TypedDict):
    """Rescue areas are now as they stand here, each with an id that is known."""

    targets: list[Target]
    """The areas."""

    type: Literal["areas_changed"]
    """What has happened."""

    id: str
    """A name of your own for this event; told again with it, it is not a second one."""

    at: NotRequired[float | None]
    """When it became known, by the mission's clock, and not before that; default: at that clock, or when a
    UAV was seen last."""


@final
class BaseLeft(TypedDict):
    """A base at the end of the plan."""

    base_id: str
    """The base."""

    stock: list[float] | None
    """Amounts left, one a material; null: as much as is asked for."""


@final
class Base(TypedDict):
    """A place where UAVs land, reload, and take off again."""

    id: NotRequired[str | None]
    """Unique among the bases; default: base-1, base-2, … by place in the list."""

    x: float
    """Position: x, or longitude in degrees."""

    y: float
    """Position: y, or latitude in degrees."""

    stock: NotRequired[list[float] | None]
    """Amounts in stock, one a material; default: as much as is asked for."""

    turnaround: NotRequired[float]
    """Time from landing until it takes off again."""

    location: NotRequired[int | None]
    """Where it is, as a row of the `matrices`; needed with them."""

    name: NotRequired[str | None]
    """Text for people, which need not be unique; default: the id."""

    properties: NotRequired[dict[str, Any] | None]
    """An object that is kept and given back unread, at most 4 KB."""


@final
class BatchItem(TypedDict):
    """An allocation, with a name by which its answer is known."""

    uavs: list[UAV]
    """The swarm."""

    targets: list[Target]
    """The rescue areas."""

    max_steps: NotRequired[int]
    """Most decision steps of a plan, S."""

    crs: NotRequired[Literal["local", "wgs84"]]
    """local: x, y on a plane, Euclidean distances. wgs84: x longitude and y latitude in degrees, great
    circles in km, speeds in km/h, times in h."""

    objective: NotRequired[Objective]
    """What a plan is paid for."""

    materials: NotRequired[list[Material]]
    """The kinds of material, in the order of every `loadlist`; default: material-1, … of weight 1."""

    bases: NotRequired[list[Base]]
    """Where UAVs land, reload and take off again; at the end each lands at the nearest, or where it began.
"""

    no_fly_zones: NotRequired[list[NoFlyZone]]
    """What must not be flown through."""

    wind: NotRequired[Wind | None]
    """Wind; default: still air."""

    matrices: NotRequired[dict[str, Matrix] | None]
    """Legs by the names of profiles, in place of distances between positions; then coordinates are for
    display alone."""

    start_plan: NotRequired[list[list[int]] | None]
    """An `assignment` to begin from and to compare with; no answer that takes a start earns less."""

    algorithm: NotRequired[str]
    """See `GET /algorithms`."""

    parameters: NotRequired[dict[str, Any]]
    """The algorithm's own; the others keep their defaults."""

    seed: NotRequired[int]
    """Source of all randomness: same request, same seed, no time limit: same answer."""

    time_limit_s: NotRequired[float | None]
    """The answer comes within this time, with the best plan so far; null: no limit."""

    keep_checkpoint: NotRequired[bool]
    """Whether what an algorithm learns is kept with the job, so that `POST /library` can register it by its
    `job_id`; half a megabyte and more."""

    bound: NotRequired[bool]
    """Whether the answer has an upper bound on the reward of any plan."""

    bound_time_limit_s: NotRequired[float]
    """Seconds to look for the bound, after the plan was found; within `time_limit_s`, of which at most a
    third is kept for it."""

    id: NotRequired[str | None]
    """Comes back with the answer; need not be unique."""


@final
class BatchRequest(TypedDict):
    """Allocations that have nothing to do with one another."""

    problems: list[BatchItem]
    """As many bodies of `POST /allocate` as the operator takes."""


@final
class Broken(TypedDict):
    """A stop of the plan that cannot be made any more, and was dropped from it."""

    target_id: NotRequired[str | None]
    """The area; absent for a reload."""

    base_id: NotRequired[str | None]
    """The base; absent for a visit."""

    uav_id: str
    """The UAV."""

    rule: str
    """The rule, for programs: as in `breaches` of `POST /evaluate`, or `uav_lost` (the UAV is lost),
    `area_cancelled` (the area was cancelled)."""

    says: str
    """The rule, for people."""

    needed: float | None
    """What the stop needs; null where the rule has no figures."""

    had: float | None
    """What there is."""


@final
class Checkpoint(TypedDict):
    """The file with a policy's weights."""

    sha256: str
    """SHA-256, hexadecimal; in quotes it is the `ETag`."""

    size: int
    """Bytes."""


@final
class ClockEvent(TypedDict):
    """Time has passed, and what is planned until then has happened."""

    type: Literal["clock"]
    """What has happened."""

    id: str
    """A name of your own for this event; told again with it, it is not a second one."""

    at: NotRequired[float | None]
    """When it became known, by the mission's clock, and not before that; default: at that clock, or when a
    UAV was seen last."""


Delivery = Literal["payload-place", "servo", "gripper", "land", "none"]
"""How material leaves the UAV at a stop."""


@final
class Differences(TypedDict):
    """How two plans differ."""

    uavs: list[RouteDifference]
    """UAVs whose stops differ."""

    visits_changed: int
    """Visits that are in one of the plans only."""


@final
class Done(TypedDict):
    """A stop that is over."""

    target_id: NotRequired[str | None]
    """The area; absent for a reload."""

    base_id: NotRequired[str | None]
    """The base; absent for a visit."""

    uav_id: str
    """The UAV."""

    time: float
    """When, by the mission's clock."""

    amounts: list[float]
    """What was unloaded, or taken up, one a material."""

    reported: bool
    """Whether an event has said so; otherwise it is what was planned."""


@final
class Effect(TypedDict):
    """What an event did to the plan in force."""

    flyable: bool
    """Whether the plan can be flown as it was."""

    broken: list[Broken]
    """Stops that cannot be made any more."""

    late: list[Late]
    """Stops that are later."""

    reward_before: float
    """What the rest of the plan earned before."""

    reward: float
    """What the rest of the plan earns now."""


Ending = Literal["return", "land"]
"""What comes after the last stop of a UAV; flights before its last one end at their base."""


@final
class Evaluation(TypedDict):
    """What a plan earns and does."""

    job_id: str
    """The job that evaluated it."""

    assignment: list[list[int]]
    """The plan."""

    reward: float
    """As of `POST /allocate`."""

    satisfaction: float
    """As of `POST /allocate`."""

    distance: float
    """As of `POST /allocate`."""

    distance_weight: float
    """λ as it was used."""

    bound: NotRequired[float | None]
    """As of `POST /allocate`."""

    gap: NotRequired[float | None]
    """As of `POST /allocate`."""

    routes: list[Route]
    """One a UAV."""

    unmet: list[Unmet]
    """Areas with needs left, each with the reason."""

    reasons: NotRequired[str]
    """As of `POST /allocate`."""

    warnings: NotRequired[list[WarningModel]]
    """As of `POST /allocate`."""

    makespan: NotRequired[float | None]
    """As of `POST /allocate`."""

    changes: NotRequired[int | None]
    """As of `POST /allocate`."""

    bases: NotRequired[list[BaseLeft] | None]
    """As of `POST /allocate`."""

    remaining: NotRequired[dict[str, Any] | None]
    """The problem as it stands at `at`, ready to be allocated: who is where with what, needs with
    `requested`, what is under way as `committed`, and the rest of the plan as `start_plan`."""

    elapsed_s: float
    """Seconds from the request's arrival to the answer."""


@final
class EvaluationRequest(TypedDict):
    """A problem, and a plan of it: as `assignment`, or as `flight_files`."""

    uavs: list[UAV]
    """The swarm."""

    targets: list[Target]
    """The rescue areas."""

    max_steps: NotRequired[int]
    """Most decision steps of a plan, S."""

    crs: NotRequired[Literal["local", "wgs84"]]
    """local: x, y on a plane, Euclidean distances. wgs84: x longitude and y latitude in degrees, great
    circles in km, speeds in km/h, times in h."""

    objective: NotRequired[Objective]
    """What a plan is paid for."""

    materials: NotRequired[list[Material]]
    """The kinds of material, in the order of every `loadlist`; default: material-1, … of weight 1."""

    bases: NotRequired[list[Base]]
    """Where UAVs land, reload and take off again; at the end each lands at the nearest, or where it began.
"""

    no_fly_zones: NotRequired[list[NoFlyZone]]
    """What must not be flown through."""

    wind: NotRequired[Wind | None]
    """Wind; default: still air."""

    matrices: NotRequired[dict[str, Matrix] | None]
    """Legs by the names of profiles, in place of distances between positions; then coordinates are for
    display alone."""

    start_plan: NotRequired[list[list[int]] | None]
    """An `assignment` to begin from and to compare with; no answer that takes a start earns less."""

    assignment: NotRequired[list[list[int]] | None]
    """One joint action a step: for each UAV the index of its target, N for home, or N + 1 + d to reload at
    base d."""

    flight_files: NotRequired[list[FlightFile] | None]
    """In place of `assignment`: a file a flight. Waypoints near an area are visits to it; who has no file
    stays where it is. The answer has the plan as `assignment`."""

    match_within: NotRequired[float]
    """m that a waypoint of `flight_files` may be away from the area or base that it is at."""

    delivered: NotRequired[list[list[list[float] | None]] | None]
    """With planned unloading, what every visit unloads: by step, UAV and material, null for nothing;
    default: the best amounts of the plan."""

    loaded: NotRequired[list[list[list[float] | None]] | None]
    """With planned loading, what every reload takes, likewise, below 0 for what it leaves behind; it goes
    with `delivered`."""

    bound: NotRequired[bool]
    """Whether the answer has an upper bound on the reward of any plan."""

    bound_time_limit_s: NotRequired[float]
    """Seconds to look for the bound."""

    at: NotRequired[float | None]
    """A clock of the plan: the answer then has the problem that remains at it."""


@final
class EventAnswer(TypedDict):
    """An event of a mission's history."""

    number: int
    """From 1, without gaps, in the order in which they took effect."""

    id: str | None
    """Your id; null for what the service has written itself."""

    type: str
    """What happened."""

    at: float
    """When it became known, by the mission's clock."""

    recorded_at: str
    """When it was put on disk, UTC."""

    event: dict[str, Any]
    """The event itself, with its `type`."""

    effect: Effect | None
    """What it did to the plan in force; null for telemetry, which counts with the next event, and for what
    the service has written itself."""

    passed_over: int | None
    """Of telemetry, how many positions were older than known ones."""


@final
class ExampleList(TypedDict):
    """The shipped example problems."""

    examples: list[Example]
    """All of them."""


@final
class Example(TypedDict):
    """A shipped example problem."""

    name: str
    """Its name."""

    href: str
    """Where it is."""


@final
class FieldError(TypedDict):
    """One thing that is wrong with a request."""

    sentence: NotRequired[str | None]
    """`detail` with places for its values, the same for every error of its kind: the key of its
    translation; none where the service has no such sentence."""

    values: NotRequired[dict[str, Any] | None]
    """By the places in `sentence`: a number, a text, a list of texts, or an object with `detail`,
    `sentence` and `values` of its own."""

    pointer: str
    """JSON pointer (RFC 6901) into the body; empty for the body as a whole."""

    detail: str
    """What is wrong."""

    parameter: NotRequired[str | None]
    """The query parameter or header, where the error is not in the body."""


@final
class FlightFile(TypedDict):
    """A flight of a UAV, as a ground station has it."""

    name: str
    """Of the file. `003-uav-3-flight-2.plan` is the second flight of the third UAV, as the service names
    files; of any other name say whose it is."""

    uav_id: NotRequired[str | None]
    """Whose flight it is; default: as the name says."""

    content: str
    """Its text: QGroundControl's `.plan`, or `QGC WPL 110` waypoints."""


@final
class Health(TypedDict):
    """The process answers."""

    status: str
    """ok."""

    version: str
    """Version of the service."""


@final
class History(TypedDict):
    """A page of a mission's history."""

    events: list[EventAnswer]
    """In their order."""

    next_after: int | None
    """`after` of the next page; null on the last."""


@final
class HistoryModel(TypedDict):
    """Reward against epoch, as in the paper's figures; two lists of one length."""

    epoch: list[int]
    """Epochs or generations."""

    reward: list[float]
    """Reward at that epoch."""


@final
class JobError(TypedDict):
    """Why a job failed."""

    sentence: NotRequired[str | None]
    """`detail` with places for its values, the same for every error of its kind: the key of its
    translation; none where the service has no such sentence."""

    values: NotRequired[dict[str, Any] | None]
    """By the places in `sentence`: a number, a text, a list of texts, or an object with `detail`,
    `sentence` and `values` of its own."""

    type: str
    """Stable name, as the `type` of a problem."""

    title: str
    """What the type means, for people."""

    detail: str
    """What went wrong."""

    errors: list[FieldError]
    """Field by field, where that is known."""

    details: dict[str, Any]
    """Further facts, such as the `sizes` there are."""


@final
class JobList(TypedDict):
    """A page of jobs."""

    jobs: list[JobSummary]
    """Newest first."""

    next_cursor: str | None
    """`cursor` of the next page; null on the last."""


@final
class Job(TypedDict):
    """A job with what it found."""

    id: str
    """32 hexadecimal digits."""

    kind: str
    """allocate, evaluate, batch (an allocation of one), train, register or replan (of a mission)."""

    status: JobStatus
    """Where it is in its life."""

    created_at: str
    """When it was asked for, UTC."""

    started_at: str | None
    """When its newest attempt began, UTC."""

    finished_at: str | None
    """When it ended, UTC."""

    error: JobError | None
    """Why it failed, if it did."""

    progress: Progress
    """How far it is."""

    result: dict[str, Any] | None
    """Of an allocation the answer of `POST /allocate`; a training's has `policy_id` too. A job that was
    cancelled in its midst has the best it had found."""


JobStatus = Literal["queued", "running", "succeeded", "failed", "cancelled"]
"""Where a job is in its life."""


@final
class JobSummary(TypedDict):
    """A job without what it found."""

    id: str
    """32 hexadecimal digits."""

    kind: str
    """allocate, evaluate, batch (an allocation of one), train, register or replan (of a mission)."""

    status: JobStatus
    """Where it is in its life."""

    created_at: str
    """When it was asked for, UTC."""

    started_at: str | None
    """When its newest attempt began, UTC."""

    finished_at: str | None
    """When it ended, UTC."""

    error: JobError | None
    """Why it failed, if it did."""

    progress: ProgressSummary
    """How far it is."""


@final
class Landing(TypedDict):
    """The end of a route."""

    time: float
    """When the UAV has landed; without `return_to_base`, when its last visit has ended."""

    path: list[list[float]] | None
    """Points `[x, y]` flown over, first and last place included; null: a straight line home."""

    base_id: NotRequired[str | None]
    """The base where it has landed; null: its starting point. Only with bases."""


@final
class Late(TypedDict):
    """A stop of the plan that is later than it was."""

    target_id: NotRequired[str | None]
    """The area; absent for a reload."""

    base_id: NotRequired[str | None]
    """The base; absent for a visit."""

    uav_id: str
    """The UAV."""

    arrival_time: float
    """When it is there now, by the mission's clock."""

    planned: float
    """When it was to be there before the event."""


@final
class LaterDeadline(TypedDict):
    """A deadline that would have to be later."""

    target_id: str
    """The rescue area."""

    by: float
    """How much later, in time units, or h."""


@final
class LevelChangedEvent(TypedDict):
    """The emergency level of an area has changed."""

    target_id: str
    """The rescue area."""

    level: float
    """Emergency level; larger is more urgent."""

    type: Literal["level_changed"]
    """What has happened."""

    id: str
    """A name of your own for this event; told again with it, it is not a second one."""

    at: NotRequired[float | None]
    """When it became known, by the mission's clock, and not before that; default: at that clock, or when a
    UAV was seen last."""


@final
class Material(TypedDict):
    """A kind of relief material."""

    name: NotRequired[str | None]
    """Text for people; default: material-1, material-2, … by place in the list."""

    weight: NotRequired[float]
    """Weight of one unit."""


@final
class Matrix(TypedDict):
    """The legs of one profile, from each of R locations to each other."""

    distance: list[list[float | None]]
    """Rows of lengths, from a row's location to a column's; it need not be symmetric. null: there is no
    such leg."""

    duration: NotRequired[list[list[float | None]] | None]
    """Rows of times, null where there is no such leg. Default: what the length takes at the UAV's speed."""


@final
class MissionAsItStands(TypedDict):
    """A mission with its state."""

    id: str
    """32 hexadecimal digits."""

    name: str | None
    """For people."""

    clock: float
    """The mission's clock: that of the newest event that made a state."""

    last_number: int
    """Number of the newest event."""

    state_number: int
    """Number of the newest event that made a state."""

    searching: bool
    """Whether a plan is looked for, or soon will be, or is about to take effect."""

    planning: Planning
    """How it is planned."""

    trouble: JobError | None
    """Why the newest search failed, if it did."""

    created_at: str
    """When it was begun, UTC."""

    state: State
    """After the newest event that made a state."""

    positions: dict[str, Seen]
    """Where UAVs were seen last, by their ids."""


@final
class MissionList(TypedDict):
    """A page of missions."""

    missions: list[Mission]
    """Newest first."""

    next_cursor: str | None
    """`cursor` of the next page; null on the last."""


@final
class Mission(TypedDict):
    """A mission without its state."""

    id: str
    """32 hexadecimal digits."""

    name: str | None
    """For people."""

    clock: float
    """The mission's clock: that of the newest event that made a state."""

    last_number: int
    """Number of the newest event."""

    state_number: int
    """Number of the newest event that made a state."""

    searching: bool
    """Whether a plan is looked for, or soon will be, or is about to take effect."""

    planning: Planning
    """How it is planned."""

    trouble: JobError | None
    """Why the newest search failed, if it did."""

    created_at: str
    """When it was begun, UTC."""


@final
class MissionRequest(TypedDict):
    """A problem, and how to plan it in the course of a day."""

    name: NotRequired[str | None]
    """For people; need not be unique."""

    problem: Problem
    """The problem as it stands at the beginning; its `start_plan` is the first plan in force."""

    algorithm: NotRequired[AlgorithmName]
    """See `GET /algorithms`."""

    parameters: NotRequired[dict[str, Any]]
    """The algorithm's own; the others keep their defaults."""

    seed: NotRequired[int]
    """Source of all randomness."""

    time_limit_s: NotRequired[float]
    """Seconds that each search for a plan has."""

    change_weight: NotRequired[float | None]
    """Reward lost for each visit of the plan in force that a new one does not make; default: the
    objective's."""

    plans: NotRequired[Literal["automatic", "proposed"]]
    """automatic: new plans take effect by themselves. proposed: when they are accepted."""


@final
class NoFlyZone(TypedDict):
    """A polygon that must not be flown through; its border may be touched."""

    id: NotRequired[str | None]
    """Unique among the zones; default: zone-1, zone-2, … by place in the list."""

    polygon: list[list[float]]
    """Corners `[x, y]` in either direction, at least 3; no two sides cross. A last corner that is the first
    one again is dropped."""

    name: NotRequired[str | None]
    """Text for people, which need not be unique; default: the id."""

    properties: NotRequired[dict[str, Any] | None]
    """An object that is kept and given back unread, at most 4 KB."""


@final
class Objective(TypedDict):
    """What a plan is paid for."""

    distance_weight: NotRequired[float | None]
    """λ, reward lost per unit of distance; 1 is Eq. (14) to the letter; null: 1 / extent."""

    return_to_base: NotRequired[bool]
    """A visit is allowed only if the UAV can still fly home."""

    charge_return: NotRequired[bool]
    """The leg home costs reward too."""

    unloading: NotRequired[Literal["greedy", "planned"]]
    """greedy: a visit unloads all that is needed and carried, the paper's rule. planned: how much it
    unloads is decided with the plan, so that a UAV can keep material for a more urgent area."""

    loading: NotRequired[Literal["refill", "planned"]]
    """refill: at a base a UAV takes what `full_load` says, as far as it is in stock. planned: what it
    takes, at most its `capacity`, is decided with the plan; needs `unloading`: planned."""

    half_life: NotRequired[float | None]
    """Time in which what a delivery earns falls to half; default: it does not fall."""

    minimum_share: NotRequired[float]
    """Share of what an area needs of a material that earns `minimum_weight` times as much."""

    minimum_weight: NotRequired[float]
    """How many times as much the first `minimum_share` earns."""

    makespan_weight: NotRequired[float]
    """Reward lost per unit of time until the last UAV has landed."""

    change_weight: NotRequired[float]
    """Reward lost for each pair of UAV and area that is visited in `start_plan` and not in the plan."""


@final
class PlanAnswer(TypedDict):
    """The plan in force."""

    assignment: list[list[int]]
    """One joint action a step, as of `POST /allocate`."""

    reward: float
    """What it earns from the state's clock on."""

    routes: list[Route]
    """One a UAV; times are by the mission's clock."""

    number: int
    """The event that it follows from."""

    clock: float
    """When it begins, by the mission's clock."""


PlanFormat = Literal[
    "geojson",
    "qgc-plan",
    "qgc-wpl",
    "csv",
    "load-sheet",
    "html",
    "briefing",
    "kml",
    "gpx",
]
"""What a plan can be taken away as."""


@final
class PlanInForce(TypedDict):
    """A plan with its times."""

    assignment: list[list[int]]
    """One joint action a step, as of `POST /allocate`."""

    reward: float
    """What it earns from the state's clock on."""

    routes: list[Route]
    """One a UAV; times are by the mission's clock."""


@final
class Planning(TypedDict):
    """How a mission is planned."""

    algorithm: str
    """What looks for plans."""

    parameters: dict[str, Any]
    """Its parameters, defaults filled in."""

    seed: int
    """The seed of each search."""

    time_limit_s: float
    """Seconds that each search has."""

    plans: Literal["automatic", "proposed"]
    """Whether new plans take effect by themselves, or are proposed."""


@final
class PolicyList(TypedDict):
    """A page of source policies."""

    policies: list[PolicySummary]
    """Newest first."""

    next_cursor: str | None
    """`cursor` of the next page; null on the last."""


@final
class Policy(TypedDict):
    """A source policy with its task."""

    id: str
    """Its id."""

    name: str
    """For people."""

    n_uavs: int
    """UAVs of the source task, M."""

    n_targets: int
    """Targets of the source task, N."""

    n_materials: int
    """Materials of the source task, K."""

    architecture: str
    """The network its weights are for."""

    algorithm: str
    """What trained it."""

    seed: int | None
    """The seed of the training."""

    metrics: dict[str, Any]
    """What was measured at its training."""

    created_at: str
    """When it was registered, UTC."""

    checkpoint: Checkpoint
    """Its weights."""

    task: dict[str, Any]
    """The source task, a problem with all defaults filled in."""

    metadata: dict[str, Any]
    """What else its checkpoint says of itself."""


@final
class PolicySummary(TypedDict):
    """A source policy without its task."""

    id: str
    """Its id."""

    name: str
    """For people."""

    n_uavs: int
    """UAVs of the source task, M."""

    n_targets: int
    """Targets of the source task, N."""

    n_materials: int
    """Materials of the source task, K."""

    architecture: str
    """The network its weights are for."""

    algorithm: str
    """What trained it."""

    seed: int | None
    """The seed of the training."""

    metrics: dict[str, Any]
    """What was measured at its training."""

    created_at: str
    """When it was registered, UTC."""

    checkpoint: Checkpoint
    """Its weights."""


@final
class Position(TypedDict):
    """Where a UAV is, and what it has used."""

    uav_id: str
    """The UAV."""

    time: float
    """When it was there, by the mission's clock."""

    x: float
    """Position: x, or longitude in degrees."""

    y: float
    """Position: y, or latitude in degrees."""

    dis: NotRequired[float | None]
    """Distance flown in this flight; default: as planned."""

    airborne: NotRequired[float | None]
    """Time in the air in this flight; default: as planned."""

    location: NotRequired[int | None]
    """Where it is, as a row of the `matrices`; default: as planned."""


@final
class Problem(TypedDict):
    """A swarm, rescue areas, and what a plan is paid for."""

    uavs: list[UAV]
    """The swarm."""

    targets: list[Target]
    """The rescue areas."""

    max_steps: NotRequired[int]
    """Most decision steps of a plan, S."""

    crs: NotRequired[Literal["local", "wgs84"]]
    """local: x, y on a plane, Euclidean distances. wgs84: x longitude and y latitude in degrees, great
    circles in km, speeds in km/h, times in h."""

    objective: NotRequired[Objective]
    """What a plan is paid for."""

    materials: NotRequired[list[Material]]
    """The kinds of material, in the order of every `loadlist`; default: material-1, … of weight 1."""

    bases: NotRequired[list[Base]]
    """Where UAVs land, reload and take off again; at the end each lands at the nearest, or where it began.
"""

    no_fly_zones: NotRequired[list[NoFlyZone]]
    """What must not be flown through."""

    wind: NotRequired[Wind | None]
    """Wind; default: still air."""

    matrices: NotRequired[dict[str, Matrix] | None]
    """Legs by the names of profiles, in place of distances between positions; then coordinates are for
    display alone."""

    start_plan: NotRequired[list[list[int]] | None]
    """An `assignment` to begin from and to compare with; no answer that takes a start earns less."""


@final
class Progress(TypedDict):
    """How far a job is, and the best it has found."""

    fraction: float
    """Of the work, 0 to 1."""

    epoch: int | None
    """Epochs done, where the work has epochs."""

    best_reward: float | None
    """Reward of the best plan so far."""

    assignment: list[list[int]] | None
    """The best plan so far."""

    answered_by: NotRequired[str | None]
    """The algorithm that found it."""


@final
class ProgressSummary(TypedDict):
    """How far a job is."""

    fraction: float
    """Of the work, 0 to 1."""

    epoch: int | None
    """Epochs done, where the work has epochs."""

    best_reward: float | None
    """Reward of the best plan so far."""


@final
class Proof(TypedDict):
    """What an algorithm knows of plans that it has not found; they unload greedily."""

    bound: float
    """No plan that unloads greedily earns more."""

    proven: bool
    """Whether the plan is the best there is."""


@final
class ProposalAcceptedEvent(TypedDict):
    """A proposal becomes the plan in force."""

    proposal: int
    """Number of the proposal."""

    type: Literal["proposal_accepted"]
    """What has happened."""

    id: str
    """A name of your own for this event; told again with it, it is not a second one."""

    at: NotRequired[float | None]
    """When it became known, by the mission's clock, and not before that; default: at that clock, or when a
    UAV was seen last."""


@final
class ProposalList(TypedDict):
    """All proposals of a mission."""

    proposals: list[Proposal]
    """Newest first."""


@final
class Proposal(TypedDict):
    """A plan that was found, and how it differs from the one in force."""

    assignment: list[list[int]]
    """One joint action a step, as of `POST /allocate`."""

    reward: float
    """What it earns from the state's clock on."""

    routes: list[Route]
    """One a UAV; times are by the mission's clock."""

    number: int
    """Its number, which is that of the event that made it."""

    status: ProposalStatus
    """What became of it."""

    of_number: int
    """The event after which it was looked for."""

    job_id: str
    """The job that found it."""

    gained: float
    """What it earns more than the plan in force, changes charged."""

    differences: Differences
    """How it differs from the plan in force then."""


@final
class ProposalRefusedEvent(TypedDict):
    """A proposal is not wanted; the plan in force stays."""

    proposal: int
    """Number of the proposal."""

    type: Literal["proposal_refused"]
    """What has happened."""

    id: str
    """A name of your own for this event; told again with it, it is not a second one."""

    at: NotRequired[float | None]
    """When it became known, by the mission's clock, and not before that; default: at that clock, or when a
    UAV was seen last."""


ProposalStatus = Literal["open", "accepted", "refused", "outdated"]
"""What became of a proposal."""


@final
class Readiness(TypedDict):
    """Store and workers answer."""

    status: str
    """ready."""

    workers_ready: int
    """Workers that are warm, busy or not."""

    workers: int
    """Workers there are when all are well."""

    jobs_running: int
    """Jobs that run."""

    jobs_waiting: int
    """Jobs that wait."""

    policies: int
    """Source policies in the library."""


@final
class RegisterCheckpoint(TypedDict):
    """Register a checkpoint that was trained elsewhere."""

    name: str
    """For people; need not be unique."""

    task: Problem
    """The source task it was trained on."""

    checkpoint: str
    """A safetensors file in base64, as `GET /library/{policy_id}/checkpoint` returns it."""


@final
class RegisterJob(TypedDict):
    """Register what an earlier job has learned."""

    name: str
    """For people; need not be unique."""

    task: NotRequired[Problem | None]
    """The source task; null: the job's own problem."""

    job_id: str
    """A job that has ended and learned something."""


@final
class RegisterTraining(TypedDict):
    """Train a source policy, and register it at the end."""

    name: str
    """For people; need not be unique."""

    task: Problem
    """The source task to train on."""

    train: Training
    """How to train."""


@final
class Relaxation(TypedDict):
    """What a problem would have to allow more of."""

    more_load: list[float]
    """Amounts more aboard the UAV, one a material."""

    more_range: float
    """Range more of the UAV."""

    more_steps: int
    """Decision steps more."""

    later_deadlines: list[LaterDeadline]
    """Deadlines that would have to be later."""


@final
class ReloadDoneEvent(TypedDict):
    """A UAV has reloaded at a base."""

    uav_id: str
    """The UAV."""

    base_id: str
    """The base."""

    loadlist: list[float]
    """Amounts that are aboard now, one a material."""

    time: NotRequired[float | None]
    """When it was done, no later than `at`; default: `at`."""

    type: Literal["reload_done"]
    """What has happened."""

    id: str
    """A name of your own for this event; told again with it, it is not a second one."""

    at: NotRequired[float | None]
    """When it became known, by the mission's clock, and not before that; default: at that clock, or when a
    UAV was seen last."""


@final
class Reload(TypedDict):
    """One landing of a UAV at a base, where it takes up material and flies on."""

    kind: Literal["reload"]
    """What the stop is."""

    base_id: str
    """The base."""

    step: int
    """Decision step, from 1."""

    arrival_time: float
    """Time units from now, or h."""

    distance: float
    """Length of the leg flown to it."""

    loaded: list[float]
    """Amounts taken up, one a material; below 0: left behind."""

    departure_time: float
    """When it may take off again."""

    path: list[list[float]] | None
    """Points `[x, y]` flown over, first and last place included; null: a straight line to it."""


@final
class ReplayEntry(TypedDict):
    """An event with the state that it made."""

    number: int
    """From 1, without gaps, in the order in which they took effect."""

    id: str | None
    """Your id; null for what the service has written itself."""

    type: str
    """What happened."""

    at: float
    """When it became known, by the mission's clock."""

    recorded_at: str
    """When it was put on disk, UTC."""

    event: dict[str, Any]
    """The event itself, with its `type`."""

    effect: Effect | None
    """What it did to the plan in force; null for telemetry, which counts with the next event, and for what
    the service has written itself."""

    passed_over: int | None
    """Of telemetry, how many positions were older than known ones."""

    state: State | None
    """The state after it; null where it made none."""


@final
class Replay(TypedDict):
    """Everything that is kept of a mission."""

    mission: Mission
    """The mission."""

    problem: dict[str, Any]
    """The problem that it began with."""

    events: list[ReplayEntry]
    """All that happened, in its order."""

    proposals: list[Proposal]
    """All plans that were proposed, newest first."""


@final
class RouteDifference(TypedDict):
    """How the stops of one UAV differ."""

    uav_id: str
    """The UAV."""

    before: list[StopRef]
    """Its stops in the one plan."""

    after: list[StopRef]
    """Its stops in the other."""

    added: list[StopRef]
    """Stops that only the other has."""

    removed: list[StopRef]
    """Stops that only the one has."""


@final
class Route(TypedDict):
    """What one UAV does: its stops in order, then home."""

    uav_id: str
    """The UAV."""

    distance: float
    """Distance of the legs to its stops, without the leg home."""

    return_distance: float
    """Length of the leg home."""

    stops: list[Stop | Reload]
    """Its visits and, where the problem has bases, reloads."""

    landing: NotRequired[Landing | None]
    """Its end; null for a UAV that does not fly. Only where the problem uses fields of the world."""


@final
class Seen(TypedDict):
    """Where a UAV was seen last."""

    time: float
    """When, by the mission's clock."""

    x: float
    """Where."""

    y: float
    """Where."""

    dis: NotRequired[float | None]
    """Distance flown, where it was told."""

    airborne: NotRequired[float | None]
    """Time in the air, where it was told."""

    location: NotRequired[int | None]
    """Row of the matrices, where it was told."""

    number: int
    """The event that it came with."""


@final
class SimilarList(TypedDict):
    """Similar source tasks."""

    similar: list[SimilarPolicy]
    """Nearest first."""


@final
class SimilarPolicy(TypedDict):
    """A source policy and how far its task is."""

    policy: PolicySummary

    distance: float
    """Sum of squared differences between the tasks' summaries or descriptions."""


@final
class SimilarRequest(TypedDict):
    """A new task."""

    task: Problem
    """The task to find similar source tasks for."""

    k: NotRequired[int]
    """How many at most."""

    similarity: NotRequired[Literal["summary", "paper"]]
    """summary: by what the tasks have in common, whatever their sizes; paper: Algorithm 2, number by
    number, which only finds tasks of the same size."""


@final
class SourcePolicy(TypedDict):
    """The policy of the library that was transferred."""

    id: str
    """Its id, see `GET /library/{policy_id}`."""

    name: str
    """Its name."""

    distance: float
    """Sum of squared differences between the task descriptions."""


@final
class StateAtMoment(TypedDict):
    """A mission at a moment: as it was, or as it is planned to be."""

    number: int
    """The event that it follows from."""

    state: State
    """What remains then."""

    plan: PlanInForce
    """The rest of the plan in force."""


@final
class State(TypedDict):
    """What remains of a mission at a moment."""

    clock: float
    """The moment."""

    problem: dict[str, Any]
    """What remains, as `POST /allocate` takes it but for matrices; `start_plan` is the plan in force."""

    done: list[Done]
    """What was done, in the order in which it became known."""

    lost: list[str]
    """Ids of UAVs that are lost."""

    cancelled: list[str]
    """Ids of areas that were cancelled."""


@final
class StockChangedEvent(TypedDict):
    """The stock of a base is now another one."""

    base_id: str
    """The base."""

    stock: NotRequired[list[float] | None]
    """Amounts in stock, one a material; default: as much as is asked for."""

    type: Literal["stock_changed"]
    """What has happened."""

    id: str
    """A name of your own for this event; told again with it, it is not a second one."""

    at: NotRequired[float | None]
    """When it became known, by the mission's clock, and not before that; default: at that clock, or when a
    UAV was seen last."""


@final
class Stop(TypedDict):
    """One visit of a UAV; the last ones only where the problem uses fields of the world, such as `wind`."""

    kind: NotRequired[Literal["visit"]]
    """Only where the problem has bases."""

    target_id: str
    """The rescue area."""

    step: int
    """Decision step, from 1."""

    arrival_time: float
    """Time units from now, or h."""

    distance: float
    """Length of the leg flown to it."""

    delivered: list[float]
    """Amounts unloaded, one a material."""

    begin_time: NotRequired[float | None]
    """When unloading begins: on arrival, or after waiting; as `arrival_time`."""

    departure_time: NotRequired[float | None]
    """When the visit has ended."""

    range_left: NotRequired[float | None]
    """Air length left on departure, of the whole `voyage`."""

    endurance_left: NotRequired[float | None]
    """Time in the air left on departure, of the whole `endurance`; null: no limit."""

    path: NotRequired[list[list[float]] | None]
    """Points `[x, y]` flown over, first and last place included; null: a straight line to it."""


@final
class StopRef(TypedDict):
    """A stop: an area that is visited, or a base where a UAV reloads."""

    target_id: NotRequired[str | None]
    """The area; absent for a reload."""

    base_id: NotRequired[str | None]
    """The base; absent for a visit."""


@final
class Target(TypedDict):
    """One rescue area (Eq. 9 of the paper)."""

    id: NotRequired[str | None]
    """Unique among the targets; default: area-1, area-2, … by place in the list."""

    x: float
    """Position: x, or longitude in degrees."""

    y: float
    """Position: y, or latitude in degrees."""

    level: float
    """Emergency level; larger is more urgent."""

    loadlist: list[float]
    """Amounts still needed, one a material."""

    deadline: NotRequired[float | None]
    """Latest arrival, in time units from now; default: none."""

    service_time: NotRequired[float]
    """Time spent unloading at a visit."""

    requested: NotRequired[list[float] | None]
    """Amounts that it asked for at first, one a material, none below its `loadlist`; what a visit earns is
    by shares of these, so an area that has nearly all is not as urgent as one that has nothing. Default:
    its `loadlist`."""

    earliest: NotRequired[float]
    """A visit begins no sooner: a UAV that arrives before waits there."""

    skills: NotRequired[list[str]]
    """A UAV must have all of these to be sent here."""

    location: NotRequired[int | None]
    """Where it is, as a row of the `matrices`; needed with them."""

    name: NotRequired[str | None]
    """Text for people, which need not be unique; default: the id."""

    properties: NotRequired[dict[str, Any] | None]
    """An object that is kept and given back unread, at most 4 KB."""


@final
class TelemetryEvent(TypedDict):
    """Positions of UAVs, and what they have used."""

    positions: list[Position]
    """The positions."""

    type: Literal["telemetry"]
    """What has happened."""

    id: str
    """A name of your own for this event; told again with it, it is not a second one."""


@final
class Training(TypedDict):
    """What to learn with."""

    algorithm: NotRequired[Literal["transfer_qmix", "qmix"]]
    """An algorithm that learns, see `GET /algorithms`."""

    parameters: NotRequired[dict[str, Any]]
    """The algorithm's own; the others keep their defaults."""

    seed: NotRequired[int]
    """Source of all randomness."""


@final
class UAV(TypedDict):
    """One UAV (Eq. 7 of the paper)."""

    id: NotRequired[str | None]
    """Unique in the swarm; default: uav-1, uav-2, … by place in the list."""

    x_s: float
    """Starting point, where it returns to: x, or longitude in degrees."""

    y_s: float
    """Starting point: y, or latitude in degrees."""

    x_c: NotRequired[float | None]
    """Current position; default: the starting point."""

    y_c: NotRequired[float | None]
    """Current position; default: the starting point."""

    speed: float
    """Average speed: distance units per time unit, or km/h."""

    voyage: float
    """Maximum range of one flight, in distance units, or km."""

    dis: NotRequired[float]
    """Distance already flown."""

    ret: NotRequired[int]
    """1 when it is returning: it gets no more tasks."""

    loadlist: list[float]
    """Amounts carried, one a material."""

    endurance: NotRequired[float | None]
    """Longest time in the air in one flight, waiting and unloading included; default: no limit."""

    airborne: NotRequired[float]
    """Time already in the air in this flight, as `dis` is for distance."""

    reserve: NotRequired[float]
    """Share of `voyage` and of `endurance` that must be left after landing."""

    available_from: NotRequired[float]
    """Its clock at the start: it takes off no sooner."""

    available_until: NotRequired[float | None]
    """Latest time to have landed; default: no limit."""

    full_load: NotRequired[list[float] | None]
    """Amounts that it leaves a base with, as far as they are in stock; default: its `loadlist`."""

    capacity: NotRequired[float | None]
    """Most weight that it carries, in the unit of the weights of `materials`; default: no limit."""

    skills: NotRequired[list[str]]
    """What it can do, in words of your own."""

    excluded: NotRequired[list[str]]
    """Ids of areas that it must not be sent to."""

    committed: NotRequired[list[str]]
    """Ids of areas that it visits first, in this order: promised, or under way."""

    bases: NotRequired[list[str] | None]
    """Ids of the bases at which it may land and reload; default: all."""

    location: NotRequired[int | None]
    """Where it is, as a row of the `matrices`; needed with them."""

    home_location: NotRequired[int | None]
    """Its starting point as a row of the `matrices`."""

    profile: NotRequired[str | None]
    """Which of the `matrices` its legs are of; default: the only one."""

    name: NotRequired[str | None]
    """Text for people, which need not be unique; default: the id."""

    properties: NotRequired[dict[str, Any] | None]
    """An object that is kept and given back unread, at most 4 KB."""


@final
class UavDelayedEvent(TypedDict):
    """A UAV stays where it is for some time; in the air that is time in the air."""

    uav_id: str
    """The UAV."""

    until: float
    """When it goes on."""

    type: Literal["uav_delayed"]
    """What has happened."""

    id: str
    """A name of your own for this event; told again with it, it is not a second one."""

    at: NotRequired[float | None]
    """When it became known, by the mission's clock, and not before that; default: at that clock, or when a
    UAV was seen last."""


@final
class UavLostEvent(TypedDict):
    """A UAV is lost: it makes no more visits, and what is aboard does not arrive."""

    uav_id: str
    """The UAV."""

    type: Literal["uav_lost"]
    """What has happened."""

    id: str
    """A name of your own for this event; told again with it, it is not a second one."""

    at: NotRequired[float | None]
    """When it became known, by the mission's clock, and not before that; default: at that clock, or when a
    UAV was seen last."""


@final
class UavsAddedEvent(TypedDict):
    """UAVs are there that were not; each with an id that is new."""

    uavs: list[UAV]
    """The UAVs."""

    type: Literal["uavs_added"]
    """What has happened."""

    id: str
    """A name of your own for this event; told again with it, it is not a second one."""

    at: NotRequired[float | None]
    """When it became known, by the mission's clock, and not before that; default: at that clock, or when a
    UAV was seen last."""


UnmetCode = Literal[
    "no_supply",
    "skills",
    "excluded",
    "no_fly_zone",
    "wind",
    "out_of_range",
    "deadline",
    "endurance",
    "too_early_to_wait",
    "available_until",
    "committed",
    "step_limit",
    "range_used",
    "time_used",
    "loads_used",
    "stock",
    "no_time_for_reload",
    "not_worth_it",
    "not_chosen",
]
"""Why a rescue area does not get all it needs, from what no plan could change to what another would."""


@final
class Unmet(TypedDict):
    """A rescue area that does not get all it needs."""

    target_id: str
    """The rescue area."""

    remaining: list[float]
    """Amounts still needed after the plan, one a material."""

    code: UnmetCode
    """The reason, for programs. `no_supply`: No UAV that can be sent carries any of what it still needs, or
    can load any. `skills`: No UAV that carries any of it has all the skills that the area asks for.
    `excluded`: Every UAV that carries any of it must not be sent there. `no_fly_zone`: No way leads
    there, or home from there, round the no-fly zones. `wind`: The wind is too strong to fly there, or
    home from there. `out_of_range`: No UAV that carries any of it has the range to fly there, not even
    directly. `deadline`: No UAV with any of it and the range is there in time, not even directly.
    `endurance`: A UAV that could bring some of it would be in the air for too long. `too_early_to_wait`:
    A UAV that could bring some of it cannot wait in the air until it opens. `available_until`: A UAV
    that could bring some of it would land too late. `committed`: The UAVs that could bring some of it
    are committed to other visits first. `step_limit`: A UAV has some of it left over and lacks only a
    decision step for one more visit. `range_used`: A UAV has some of it left over, but its other visits
    leave it too little range. `time_used`: A UAV has some of it left over, but its other visits leave
    too little time. `loads_used`: The UAVs that could serve it unload elsewhere all that it could use.
    `stock`: What the UAVs carry of it is unloaded elsewhere, and the bases have none left.
    `no_time_for_reload`: A base has some of it left, but no UAV the time to fetch it and bring it.
    `not_worth_it`: One more visit would cost more distance than it earns. `not_chosen`: One more visit
    would earn something; if it is not verified, nobody has looked."""

    reason: str
    """The reason, for people, with its numbers."""

    uav_id: NotRequired[str | None]
    """The UAV that could serve it, or comes closest to it; null: none."""

    step: NotRequired[int | None]
    """The decision step, from 1, in which that UAV would visit it; its later visits come one step later.
    Where the plan has this visit already and more is to be aboard, no other is needed. null: not
    evaluated."""

    remedy: NotRequired[str | None]
    """What would change it, for people; null: nothing simple would."""

    relaxation: NotRequired[Relaxation | None]
    """What the problem has to allow for the remedy, for programs; null: nothing, or no remedy."""

    reward_change: NotRequired[float | None]
    """Change of the reward with that visit once the remedy is there, or, without a remedy, as things are;
    visits that it makes illegal are left out; null: not evaluated."""

    verified: NotRequired[bool]
    """Whether the reason is verified: where it depends on the plan, by the exact reward of every single
    additional visit of any UAV at any place in its route; of very many unmet areas only the most urgent
    ones are."""


@final
class Unsupported(TypedDict):
    """A field of a problem that an algorithm refuses."""

    field: str
    """Its name, such as `no_fly_zones` or `objective.half_life`."""

    mode: str | None
    """In which `mode` of the algorithm; null: it has none."""

    reason: str
    """Why, and what to do instead."""


@final
class VisitDoneEvent(TypedDict):
    """A UAV has visited an area."""

    uav_id: str
    """The UAV."""

    target_id: str
    """The rescue area."""

    delivered: list[float]
    """Amounts that it has really unloaded, one a material."""

    time: NotRequired[float | None]
    """When it was done, no later than `at`; default: `at`."""

    type: Literal["visit_done"]
    """What has happened."""

    id: str
    """A name of your own for this event; told again with it, it is not a second one."""

    at: NotRequired[float | None]
    """When it became known, by the mission's clock, and not before that; default: at that clock, or when a
    UAV was seen last."""


@final
class WarningModel(TypedDict):
    """Something in the request that is taken as it is, but was probably not meant."""

    pointer: str
    """JSON pointer to it in the problem (RFC 6901)."""

    code: Literal[
        "all_returning",
        "committed_beyond_steps",
        "committed_in_vain",
        "coordinates_swapped",
        "deadline_passed",
        "degrees_on_plane",
        "earliest_after_deadline",
        "far_point",
        "inside_zone",
        "never_available",
        "no_capacity",
        "no_level",
        "none_in_range",
        "not_carried",
        "not_needed",
        "nothing_needed",
        "one_place",
        "range_implausible",
        "range_spent",
        "speed_implausible",
        "wind_too_strong",
        "waypoint_passed_over",
    ]
    """What it is, for programs."""

    detail: str
    """What it is, for people, with its numbers."""


@final
class WindChangedEvent(TypedDict):
    """The wind is now another one."""

    wind: NotRequired[Wind | None]
    """Wind; default: still air."""

    type: Literal["wind_changed"]
    """What has happened."""

    id: str
    """A name of your own for this event; told again with it, it is not a second one."""

    at: NotRequired[float | None]
    """When it became known, by the mission's clock, and not before that; default: at that clock, or when a
    UAV was seen last."""


@final
class Wind(TypedDict):
    """A wind that is the same everywhere."""

    speed: float
    """Its speed: distance units per time unit, or km/h."""

    towards: float
    """Where it blows to, in degrees clockwise from north, which is +y."""


@final
class ZonesChangedEvent(TypedDict):
    """The no-fly zones are now these, and no others."""

    no_fly_zones: list[NoFlyZone]
    """All zones there are now."""

    type: Literal["zones_changed"]
    """What has happened."""

    id: str
    """A name of your own for this event; told again with it, it is not a second one."""

    at: NotRequired[float | None]
    """When it became known, by the mission's clock, and not before that; default: at that clock, or when a
    UAV was seen last."""


@final
class ProblemDetails(TypedDict):
    """Problem details (RFC 9457). Some problems have more members, such as `sizes` or `algorithms`."""

    sentence: NotRequired[str | None]
    """`detail` with places for its values, the same for every error of its kind: the key of its
    translation; none where the service has no such sentence."""

    values: NotRequired[dict[str, Any] | None]
    """By the places in `sentence`: a number, a text, a list of texts, or an object with `detail`,
    `sentence` and `values` of its own."""

    type: str
    """Stable name of the problem; it leads to what it means and what to do about it."""

    title: str
    """What the type means, for people; the same for every problem of the type."""

    status: int
    """HTTP status."""

    detail: str
    """What is wrong with this request."""

    instance: str
    """Path of the request."""

    errors: NotRequired[list[FieldError] | None]
    """What is wrong, field by field, where that is known."""


@final
class BatchLine(TypedDict):
    """The answer to one allocation of a batch: a plan, or why there is none."""

    index: int
    """Its place in the request, from 0."""

    id: NotRequired[str | None]
    """As in the request, if it has one there."""

    allocation: NotRequired[Allocation | None]
    """The plan."""

    problem: NotRequired[dict[str, Any] | None]
    """Problem details (RFC 9457), as `POST /allocate` would have answered."""


Event = (
    TelemetryEvent
    | ClockEvent
    | VisitDoneEvent
    | ReloadDoneEvent
    | UavLostEvent
    | UavsAddedEvent
    | UavDelayedEvent
    | AreasAddedEvent
    | AreasChangedEvent
    | AreaCancelledEvent
    | LevelChangedEvent
    | StockChangedEvent
    | ZonesChangedEvent
    | WindChangedEvent
    | ProposalAcceptedEvent
    | ProposalRefusedEvent
)


Registration = RegisterCheckpoint | RegisterTraining | RegisterJob


@final
class AllocationOptions(TypedDict):
    """How a problem is solved."""

    algorithm: NotRequired[AlgorithmName]
    """See `GET /algorithms`."""

    parameters: NotRequired[dict[str, Any]]
    """The algorithm's own; the others keep their defaults."""

    seed: NotRequired[int]
    """Source of all randomness: same request, same seed, no time limit: same answer."""

    time_limit_s: NotRequired[float | None]
    """The answer comes within this time, with the best plan so far; null: no limit."""

    keep_checkpoint: NotRequired[bool]
    """Whether what an algorithm learns is kept with the job, so that `POST /library` can register it by its
    `job_id`; half a megabyte and more."""

    bound: NotRequired[bool]
    """Whether the answer has an upper bound on the reward of any plan."""

    bound_time_limit_s: NotRequired[float]
    """Seconds to look for the bound, after the plan was found; within `time_limit_s`, of which at most a
    third is kept for it."""


@final
class EvaluationOptions(TypedDict):
    """What is asked of a plan."""

    flight_files: NotRequired[list[FlightFile] | None]
    """In place of `assignment`: a file a flight. Waypoints near an area are visits to it; who has no file
    stays where it is. The answer has the plan as `assignment`."""

    match_within: NotRequired[float]
    """m that a waypoint of `flight_files` may be away from the area or base that it is at."""

    delivered: NotRequired[list[list[list[float] | None]] | None]
    """With planned unloading, what every visit unloads: by step, UAV and material, null for nothing;
    default: the best amounts of the plan."""

    loaded: NotRequired[list[list[list[float] | None]] | None]
    """With planned loading, what every reload takes, likewise, below 0 for what it leaves behind; it goes
    with `delivered`."""

    bound: NotRequired[bool]
    """Whether the answer has an upper bound on the reward of any plan."""

    bound_time_limit_s: NotRequired[float]
    """Seconds to look for the bound."""

    at: NotRequired[float | None]
    """A clock of the plan: the answer then has the problem that remains at it."""


@final
class MissionOptions(TypedDict):
    """How a mission is planned."""

    name: NotRequired[str | None]
    """For people; need not be unique."""

    algorithm: NotRequired[AlgorithmName]
    """See `GET /algorithms`."""

    parameters: NotRequired[dict[str, Any]]
    """The algorithm's own; the others keep their defaults."""

    seed: NotRequired[int]
    """Source of all randomness."""

    time_limit_s: NotRequired[float]
    """Seconds that each search for a plan has."""

    change_weight: NotRequired[float | None]
    """Reward lost for each visit of the plan in force that a new one does not make; default: the
    objective's."""

    plans: NotRequired[Literal["automatic", "proposed"]]
    """automatic: new plans take effect by themselves. proposed: when they are accepted."""


@final
class SimilarOptions(TypedDict):
    """How tasks are compared."""

    k: NotRequired[int]
    """How many at most."""

    similarity: NotRequired[Literal["summary", "paper"]]
    """summary: by what the tasks have in common, whatever their sizes; paper: Algorithm 2, number by
    number, which only finds tasks of the same size."""


@final
class PlanChoices(TypedDict):
    """What a file of a plan is to be like."""

    uav: NotRequired[str | None]
    """Id of the UAV whose flights these are; default: all."""

    altitude: NotRequired[float]
    """Flights: m, the lowest one."""

    altitude_step: NotRequired[float]
    """Flights: m that each further UAV of a place, or leg near others, flies above the one before it."""

    altitude_by: NotRequired[AltitudeBy]
    """Flights: what has an altitude of its own. uav: each UAV, so that those of one place are apart. leg:
    each leg of a UAV, so that it is apart from every leg of another UAV that it crosses or comes near."""

    clearance: NotRequired[float]
    """With altitude_by=leg: m that legs of one altitude are away from each other."""

    altitude_of: NotRequired[list[str] | None]
    """Flights: altitude in m of a UAV, as `uav-7=90`, or of a leg, `uav-7/2=90` to its second stop (reloads
    are stops, the last leg leads home), from `@terrain` or `@home`."""

    altitude_reference: NotRequired[AltitudeReference | None]
    """Flights: what altitudes are measured from; default: home, but the terrain for flights of more than 5
    km, and with altitude_by=leg for all if one is so long or they start at several places."""

    launch_interval: NotRequired[float]
    """Flights: seconds between two take-offs at one place; later ones wait."""

    delivery: NotRequired[Delivery]
    """Flight files: how material is left at a stop. payload-place: MAV_CMD_NAV_PAYLOAD_PLACE; servo:
    MAV_CMD_DO_SET_SERVO; gripper: MAV_CMD_DO_GRIPPER; land: land and take off again; none: fly there."""

    end: NotRequired[Ending]
    """Flight files: home after a UAV's last stop, or land there."""

    servo_channel: NotRequired[int]
    """With delivery=servo: the output."""

    servo_pwm: NotRequired[int]
    """With delivery=servo: pulse width that releases, µs."""

    gripper: NotRequired[int]
    """With delivery=gripper: which one."""

    max_descent: NotRequired[float]
    """With delivery=payload-place: m it may go down to find the ground; 0: no limit."""

    title: NotRequired[str | None]
    """html: what stands above the plan; default: its id."""

    begins: NotRequired[str | None]
    """html: when it begins, by the clock where it is flown; default: times count from 0."""
