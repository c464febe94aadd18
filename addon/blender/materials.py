"""Materials of a scene as rows of core Materials, each read once; what only Cycles can tell is one render for all."""

from __future__ import annotations

from ..core.scene import Material
from .private_render import RenderError
from .read_images import Images
from .read_materials import MaterialReading
from .render_colours import rendered_means
from .texture_coordinates import Coordinates

NO_MATERIAL = Material("no material")
EVERY_RAY = (True, True)  # shadow rays, and light that bounces


class Materials:
    """The materials of one scene; ``entries[i]`` has the coordinates ``coordinates[i]``, and is final once finished."""

    def __init__(self, depsgraph, warn):
        self.entries = [NO_MATERIAL]
        self.coordinates = [Coordinates()]
        self.volumes = set()  # rows of those that have no surface
        self._indices, self._on_unseen = {}, {}
        self._guessed, self._sentences = [()], [()]  # of each entry; what was read of its images is not to stay
        self._depsgraph = depsgraph
        self._warn = warn
        self._images = Images(warn)

    def index_of(self, material, is_seen_by=EVERY_RAY) -> int:
        """Row of a Blender material (or None) in ``entries``, on objects that shadow rays and light meet, or one of
        them."""
        row = self._own_row(material)
        if is_seen_by == EVERY_RAY:
            return row
        if (row, is_seen_by) not in self._on_unseen:
            self._on_unseen[row, is_seen_by] = self._add(self.entries[row], self.coordinates[row])
            if row in self.volumes:
                self.volumes.add(self._on_unseen[row, is_seen_by])
        return self._on_unseen[row, is_seen_by]

    def _own_row(self, material):
        if material is None:
            return 0
        key = material.original.as_pointer()
        if key not in self._indices:
            reading = MaterialReading(material.evaluated_get(self._depsgraph), self._images)
            entry, coordinates = reading.material(), reading.coordinates()
            if reading.is_volume:
                self.volumes.add(len(self.entries))
            self._indices[key] = self._add(entry, coordinates, tuple(reading.guessed), reading.sentences())
        return self._indices[key]

    def _add(self, entry, coordinates, guessed=(), sentences=()):
        for rows, value in zip(
            (self.entries, self.coordinates, self._guessed, self._sentences), (entry, coordinates, guessed, sentences)
        ):
            rows.append(value)
        return len(self.entries) - 1

    def finish(self) -> None:
        """Have Cycles tell what could not be read, in one render for all, and say what is noteworthy."""
        inputs = [place for guessed in self._guessed for place in guessed]
        means = self._rendered(inputs) if inputs else {}
        for row, guessed in enumerate(self._guessed):
            told = {place: means[place] for place in guessed if place in means}
            if told:
                self._read_again(row, told)
            for sentence in self._sentences[row]:
                self._warn(f"material '{self.entries[row].name}': {sentence}")
        for (row, is_seen_by), on_unseen in self._on_unseen.items():
            self.entries[on_unseen] = self.entries[row].seen_by(*is_seen_by)

    def _read_again(self, row, told):
        original = next(iter(told)).material  # what was evaluated may be gone after a render
        reading = MaterialReading(original.evaluated_get(self._depsgraph), self._images, told)
        entry = reading.material()
        if reading.coordinates() == self.coordinates[row]:  # by which triangles have their UVs
            self.entries[row], self._sentences[row] = entry, reading.sentences()

    def _rendered(self, inputs):
        try:
            means = rendered_means(inputs, self._depsgraph.scene.frame_current)
        except RenderError as error:
            self._warn(f"what cannot be read of materials cannot be rendered either: {error}")
            return {}
        return {place: mean for place, mean in zip(inputs, means) if mean is not None}
