"""The strategies of a comparison: what each changes in a job. Part, stock, holding, cutters, limits, machine and
material are the job's for all."""

from dataclasses import dataclass

from bonecam.job import Job, PathJob
from bonecam.job.path_section import OF_MORPH


@dataclass(frozen=True)
class Strategy:
    """A way to machine the part: its name in tables and files, and what it is."""

    name: str
    title: str

    @property
    def is_morph(self) -> bool:
        """Whether it cuts the levels of a morph."""
        return self.name in MORPHS

    def job(self, job: Job) -> Job:
        """The job by this strategy."""
        if self.name == "published":
            methods = {
                "strategy": "morph",
                "pattern": "published",
                "orientation": "published" if job.path.orientation == "published" else "lead",
                "certify": "distances",
            }
            return job.with_values(levels={"method": "published", "even": False}, path=methods)
        if self.is_morph:
            return job.with_values(path={"strategy": "morph"})
        defaults = PathJob()
        own = {name: getattr(defaults, name) for name in OF_MORPH}
        return job.with_values(path={"strategy": self.name, **own})


MORPHS = ("published", "bonecam")
"""Names of the strategies that morph."""
STRATEGIES = (
    Strategy("published", "morphing as published: printed program of the levels, whole zig-zag, lead angle"),
    Strategy("bonecam", "morphing as bonecam does it, by the job"),
    Strategy("iso-height", "iso-height milling from both sides"),
    Strategy("rotary", "sectional rotary milling"),
)
"""All of them, in the order of the table."""
MORPH = STRATEGIES[1]
"""The one whose levels are those of the job."""
