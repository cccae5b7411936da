"""A mesh under repair, with the sentences that tell what was done to it."""

from dataclasses import dataclass

from bonecam.errors import counted
from bonecam.mesh.meshlab import from_meshset, to_meshset
from bonecam.mesh.triangle_mesh import TriangleMesh


@dataclass(frozen=True, eq=False)
class RepairState:
    """A mesh, and a sentence for each change that led to it."""

    mesh: TriangleMesh
    done: tuple[str, ...] = ()

    def then(self, mesh: TriangleMesh, *sentences: str) -> "RepairState":
        """The next state: the changed mesh, and sentences that tell the change."""
        return RepairState(mesh, self.done + sentences)


def apply_filter(
    state: RepairState, name: str, elements: str = "", sentence: str = "", noun: str = ""
) -> RepairState:
    """`state` after one MeshLab filter.

    The sentence is added where the number of `elements` (faces or vertices) changed.
    """
    meshset = to_meshset(state.mesh)
    getattr(meshset, name)()
    mesh = from_meshset(meshset)
    changed = abs(len(getattr(mesh, elements)) - len(getattr(state.mesh, elements))) if elements else 0
    return state.then(mesh, *((sentence.format(counted(changed, noun)),) if changed else ()))


def apply_filters(state: RepairState, filters: tuple[tuple[str, str, str, str], ...]) -> RepairState:
    """`state` after MeshLab filters: name, elements that are counted, sentence and noun of each."""
    for name, elements, sentence, noun in filters:
        state = apply_filter(state, name, elements, sentence, noun)
    return state
