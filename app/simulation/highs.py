"""HiGHS as it is used here: quiet, on one thread, whatever else uses it in the same process."""

from __future__ import annotations

import highspy


class QuietHighs(highspy.Highs):
    """HiGHS without its banner, which the first of a process prints on standard output as it is built."""

    def __init__(self, **options: str | float) -> None:
        """Build it with these of HiGHS's options."""
        super().__init__()  # type: ignore[no-untyped-call]  # untyped in highspy
        for option, value in {"threads": 1, **options}.items():
            self.setOptionValue(option, value)

    def enableCallbacks(self) -> None:  # noqa: N802 - HiGHS's name
        """Keep quiet: the constructor calls this before it prints."""
        self.setOptionValue("output_flag", False)
        super().enableCallbacks()  # type: ignore[no-untyped-call]  # untyped in highspy

    def limit(self, seconds: float) -> None:
        """Limit the time of the next run; HiGHS's clock goes on from one run to the next."""
        self.setOptionValue("time_limit", self.getRunTime() + max(0.0, seconds))

    def optimise(self) -> bool:
        """Run; whether an optimum was found.

        HiGHS's threads are the process's: another user of it may have begun with more of them.
        """
        if self.run() == highspy.HighsStatus.kError:
            highspy.Highs.resetGlobalScheduler(True)
            self.run()
        return bool(self.getModelStatus() == highspy.HighsModelStatus.kOptimal)
