/** The service's public API: JSON, problem details, keys, entity tags and event streams. */

import { saidErrors, saidOfProblem } from "./said.js";
import { t } from "./texts.js";

const KEY = "allocator-key";
const RETRY_MS = 1000;
/** A stream that is silent so long is cut off: the service says something every 15 s. */
const SILENCE_MS = 40_000;
/** What a service answers that will be back: too busy, starting, or behind a gateway that does not reach it. */
const PASSING = new Set([0, 429, 502, 503, 504]);
let askForKey = async () => null;
let asking = null;

/**
 * An answer that is no success; `problem` is its problem details as the service wrote them, its message and `violations`, its
 * errors field by field, are in the language of the page.
 * Its status is 0 where the service could not be reached.
 */
export class ApiError extends Error {
  constructor(status, problem, retryAfter = null) {
    super(saidOfProblem(problem) ?? t("the service answered {status}", { status }));
    this.status = status;
    this.problem = problem;
    this.violations = saidErrors(problem.errors);
    this.retryAfter = retryAfter;
  }
}

/** Say how a key is asked for: a function that is told why another is needed, or null, and resolves to the key, or null. */
export function onKeyNeeded(ask) {
  askForKey = ask;
}

/** Use a key from now on; null: none. */
export function useKey(key) {
  if (key) sessionStorage.setItem(KEY, key);
  else sessionStorage.removeItem(KEY);
}

/** Whether there is a key. */
export function hasKey() {
  return sessionStorage.getItem(KEY) !== null;
}

/** The address of a path of the API, whatever prefix the service stands behind. */
export function address(path) {
  return new URL(path.replace(/^\//, ""), document.baseURI).href;
}

/**
 * Send a request; a 401 asks for a key and tries again, until one is right or none is given.
 * @param {string} path
 * @param {{method?: string, body?: any, headers?: object, signal?: AbortSignal}} [options] body is sent as JSON
 * @returns {Promise<Response>} of a status below 400
 * @throws {ApiError}
 */
export async function send(path, { method = "GET", body, headers = {}, signal } = {}) {
  for (;;) {
    const key = sessionStorage.getItem(KEY);
    const response = await reached(path, {
      method,
      signal,
      headers: {
        ...(body === undefined ? {} : { "Content-Type": "application/json" }),
        ...(key ? { Authorization: `Bearer ${key}` } : {}),
        ...headers,
      },
      body: body === undefined ? undefined : JSON.stringify(body),
    });
    if (response.ok || response.status === 304) return response;
    const problem = await response.json().catch(() => ({}));
    if (response.status === 401 && (await otherKey(key, saidOfProblem(problem)))) continue;
    throw new ApiError(response.status, problem, response.headers.get("Retry-After"));
  }
}

async function reached(path, options) {
  try {
    return await fetch(address(path), options);
  } catch (error) {
    if (options.signal?.aborted) throw error;
    throw new ApiError(0, { detail: t("The service cannot be reached") });
  }
}

/** Whether there is another key than the one refused; requests that need one at the same time share the question. */
async function otherKey(refused, why) {
  if (sessionStorage.getItem(KEY) !== refused) return true;
  asking ??= askForKey(refused === null ? null : why).finally(() => { asking = null; });
  const given = await asking;
  if (given) useKey(given);
  return Boolean(given);
}

/** Like send, with the answer's JSON. */
export async function json(path, options) {
  return (await send(path, options)).json();
}

/**
 * Read a resource that has an entity tag, unless it is still the one known.
 * @param {string} path
 * @param {string | null} etag of the copy at hand
 * @returns {Promise<{etag: string | null, body: Blob | null}>} body is null where nothing changed
 */
export async function changed(path, etag) {
  const response = await send(path, etag ? { headers: { "If-None-Match": etag } } : {});
  return { etag: response.headers.get("ETag"), body: response.status === 304 ? null : await response.blob() };
}

/** Whether what went wrong may pass by itself, so that the same can be asked again. */
export function mayPass(error) {
  return !(error instanceof ApiError) || PASSING.has(error.status);
}

/**
 * Listen to server-sent events, going on after the last one seen where the connection breaks or the service is started
 * again.
 * @param {string} path
 * @param {(event: {name: string, id: string | null, data: string}) => boolean | void} heard true: it was the last one
 * @param {{last?: string | null, opened?: () => void, lost?: () => void, signal?: AbortSignal}} [options] `last` is the id of the last
 *   event that is known; `opened` is called each time there is a connection, `lost` each time there is none any more
 * @returns {Promise<void>} at the last event, or where the signal is aborted
 * @throws {ApiError} where the service refuses
 */
export async function listen(path, heard, { last = null, opened = () => {}, lost = () => {}, signal } = {}) {
  for (;;) {
    try {
      const response = await send(path, { signal, headers: last === null ? {} : { "Last-Event-ID": last } });
      opened();
      for await (const event of events(response.body)) {
        last = event.id ?? last;
        if (heard(event)) return;
      }
    } catch (error) {
      if (!signal?.aborted && !mayPass(error)) throw error;
    }
    if (signal?.aborted) return;
    lost();
    await pause();
  }
}

function pause() {
  return new Promise((resolve) => setTimeout(resolve, RETRY_MS));
}

/**
 * Follow a job's events to its end, and read the job.
 * @param {string} id of the job
 * @param {(data: object) => void} tell
 * @param {() => void} [lost] called each time the service is not there
 * @returns {Promise<object>} the job at its end
 */
export async function follow(id, tell, lost = () => {}) {
  const heard = ({ name, data }) => {
    if (data) tell(JSON.parse(data));
    return name === "end";
  };
  await listen(`jobs/${id}/events`, heard, { lost });
  for (;;) {
    try {
      return await json(`jobs/${id}`);
    } catch (error) {
      if (!mayPass(error)) throw error;
    }
    lost();
    await pause();
  }
}

/** Server-sent events of a stream of bytes (EventSource can send no key). */
async function* events(stream) {
  const reader = stream.getReader();
  const decoder = new TextDecoder();
  let text = "";
  try {
    for (;;) {
      const { value, done } = await heard(reader);
      if (done) return;
      text = (text + decoder.decode(value, { stream: true })).replace(/\r\n/g, "\n");
      for (let end = text.indexOf("\n\n"); end >= 0; end = text.indexOf("\n\n")) {
        yield parsed(text.slice(0, end));
        text = text.slice(end + 2);
      }
    }
  } finally {
    void reader.cancel().catch(() => {});
  }
}

/** Read on, but not for ever: a link that is gone does not always say so. */
async function heard(reader) {
  let timer = null;
  const silence = new Promise((_, reject) => { timer = setTimeout(() => reject(new ApiError(0, { detail: t("The service has gone silent") })), SILENCE_MS); });
  try {
    return await Promise.race([reader.read(), silence]);
  } finally {
    clearTimeout(timer);
  }
}

function parsed(block) {
  const event = { name: "message", id: null, data: "" };
  for (const line of block.split("\n")) {
    const [, field, value] = /^(\w*): ?(.*)$/.exec(line) ?? [];
    if (field === "event") event.name = value;
    else if (field === "id") event.id = value;
    else if (field === "data") event.data += value;
  }
  return event;
}
