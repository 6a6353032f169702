"""The picture of a machine within tolerance: its working volume, coloured by the expected error."""

from dataclasses import dataclass
from functools import cached_property

from warpspace.field.grid import build_grid
from warpspace.picture.scene_picture import ScenePicture
from warpspace.scene.concepts import Concept, expected_um, zero_field
from warpspace.units import Array


@dataclass(frozen=True, kw_only=True)
class ConceptPicture(ScenePicture):
    """A nominal volume with the RMS of |E| of machines within tolerance.

    Attributes
    ----------
    concept : Concept
    expected_um : ndarray, [nx, ny, nz], µm
    """

    concept: Concept
    expected_um: Array

    @cached_property
    def values(self) -> Array:
        """What is coloured at each node, [nx, ny, nz], µm."""
        return self.expected_um


def picture_concept(concept: Concept, nodes: int) -> ConceptPicture:
    """Evaluate the expected error of a concept over its working volume.

    Parameters
    ----------
    concept : Concept
    nodes : int
        Of the grid, per axis.

    Returns
    -------
    ConceptPicture
    """
    scene = concept.scene
    grid = build_grid(scene.model, scene.workspace, nodes)
    return ConceptPicture(
        view=concept.sampled.view,
        grid=grid,
        field=zero_field(grid),
        exaggeration=1.0,
        scene=scene,
        concept=concept,
        expected_um=expected_um(concept, grid),
    )
