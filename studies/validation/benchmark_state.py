"""State of a run of the bench, and rows of its table from the answers of measured processes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from geometry.design import Design, paper
from geometry.messages import Progress
from studies.validation.benchmark_cases import Fields
from studies.validation.benchmark_statistics import Answer
from studies.validation.benchmark_tables import BenchRow


@dataclass(slots=True)
class Bench:
    """Options of a run, its rows so far, and the chosen accuracy of each case.

    Attributes
    ----------
    earlier : folder with the packages of the earlier commit; None leaves the comparison out.
    flops_per_s, bytes_per_s : rates of the machine; 0 leaves the floors out.
    """

    quick: bool
    peers: Path
    ccx: str
    progress: Progress | None
    design: Design = field(default_factory=paper)
    rows: list[BenchRow] = field(default_factory=list)
    versions: dict[str, str] = field(default_factory=dict)
    references: dict[str, list[Sequence[float]]] = field(default_factory=dict)
    chosen: dict[str, Answer] = field(default_factory=dict)
    done: float = 0.0
    earlier: Path | None = None
    flops_per_s: float = 0.0
    bytes_per_s: float = 0.0

    @property
    def runs(self) -> int:
        return 3 if self.quick else 5

    def say(self, text: str) -> None:
        if self.progress is not None:
            self.progress(self.done, text)


def row(case: str, program: str, setting: str, answer: Answer | None = None, /, *, goal: str = "") -> BenchRow:
    """A row of the table from the answer of a process; what is not known is None."""
    answer = answer or {}
    forces = answer.get("forces_N")
    return BenchRow(
        case,
        program,
        setting,
        dofs=answer.get("dofs"),
        iterations=answer.get("iterations"),
        runs=answer.get("runs"),
        import_s=answer.get("import_s"),
        cpu_s=answer.get("cpu_s"),
        mesh_s=answer.get("mesh_s"),
        wall_s=answer.get("wall_s"),
        peak_MB=answer.get("peak_MB"),
        force_N=forces[-1] if forces else None,
        error_percent=answer.get("error_percent"),
        goal=goal,
        status=answer.get("status", "ok"),
        message=answer.get("message", ""),
    )


def spec(model: str, magnet: str, loads: Sequence[Fields], accuracy: Fields) -> Answer:
    """What `studies.validation.benchmark_worker` is to solve."""
    return {"task": "trace", "model": model, "magnet": magnet, "loads": list(loads), "accuracy": accuracy}
