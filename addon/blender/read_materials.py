"""Shader nodes -> reflectance, radiance, transmittance, translucence.

Everything reflects as a two-sided Lambertian surface: a glossy or metallic shader is read by its colour. An Emission of
colour x strength has that radiance L (strength 3 bakes as 3.0 in Cycles, tested), so no pi enters here.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..core.scene import BRIGHTEST, Material
from .colour_nodes import read_colour_node
from .mesh_colours import MeshColours
from .object_colours import ObjectColours
from .private_render import ON_DIFFUSE_SURFACES
from .read_images import RIM, mean_colour
from .read_mesh import BAKED_COLOURS
from .render_colours import ShaderInput, feeding
from .shader_nodes import (
    Reached,
    Unreadable,
    conductor_colour,
    constant,
    constant_colour,
    follow,
    output_input,
    surface_shader,
)
from .surfaces import Colour, Surface, grey, mean_of_channels, pointwise, weighted_sum
from .texture_coordinates import Coordinates, read_coordinates, with_own_mapping
from .two_sides import as_shadow_rays_see, two_sided
from .view_nodes import mean_over_view

DIFFUSE = {"BSDF_DIFFUSE": "Color", "SUBSURFACE_SCATTERING": "Color", "BSDF_TOON": "Color"}
VELVET = {"BSDF_SHEEN": "Color"}
# what white sheen reflects of light from all around, by roughness: as Cycles shows it in a white room
SHEEN = (0.0, 0.1, 0.3, 0.5, 0.7, 1.0), (0.0, 0.003, 0.035, 0.118, 0.244, 0.447)
# of a coat of IOR 1.5, in its thickness: the mean of 1 / cos within it over directions that diffuse light leaves for
COAT_DEPTH = 1.15
GLOSSY = {
    "BSDF_GLOSSY": "Color",
    "BSDF_ANISOTROPIC": "Color",
    "BSDF_METALLIC": "Base Color",
    "EEVEE_SPECULAR": "Base Color",
}
TRANSLUCENT = {"BSDF_TRANSLUCENT": "Color"}
PASSING = {"BSDF_TRANSPARENT", "BSDF_GLASS", "BSDF_REFRACTION"}
OF_SHADOW_RAYS = {"Is Shadow Ray": 1.0}
KINDS_OF_RAYS = {
    *("Is Camera Ray", "Is Glossy Ray", "Is Singular Ray", "Is Transmission Ray", "Is Volume Scatter Ray"),
    *ON_DIFFUSE_SURFACES,
    *OF_SHADOW_RAYS,
}
COLOURS_OF_OBJECT = {"Color", "Alpha", "Random"}  # outputs of an Object Info node
COLOURS_OF_MESH = {"VERTEX_COLOR": "layer_name", "ATTRIBUTE": "attribute_name"}  # nodes, and what names the attribute
SEEN_BY_ANGLE = {"FRESNEL", "LAYER_WEIGHT"}
# Their output depends on the ray: where they cannot be read, 0 is a front, and no kind of ray that a bake has.
BY_VIEW = {*SEEN_BY_ANGLE, "LIGHT_PATH", "NEW_GEOMETRY"}

ALL = Colour(np.ones(3))
NOTHING = Surface(transmittance=ALL)  # all light passes
EVEN = 1e-6  # apart: an image is of one grey


def rest_of(share: Colour) -> Colour:
    """1 less a share of [0, 1]."""
    return pointwise(lambda c: 1 - c, share)


class Notes:
    """What is to be remembered of nodes that were read, each once: images' coordinates, sentences for the report, and
    those that say what was guessed."""

    def __init__(self):
        self.coordinates, self.sentences, self.guesses = {}, {}, {}
        self.asked = set()  # what else might see it in another way: "back", "shadow rays"

    def add(self, other) -> None:
        self.coordinates |= other.coordinates
        self.asked |= other.asked
        self.sentences |= other.sentences
        self.guesses |= other.guesses


class MaterialReading:
    """One material being read, each node once; what is noted of a node that turns out unreadable is forgotten.

    ``told`` are the mean colours of shaders' inputs that need not be guessed, ``guessed`` those inputs that were.
    ``sees`` is what looks at the material: "front" or "back", light that bounces, or "shadow rays".
    """

    def __init__(self, blender_material, images, told=None, sees="front"):
        self.blender_material = blender_material
        self.guessed: dict[ShaderInput, bool] = {}
        self._told = told or {}
        self._images = images
        self._notes = Notes()
        self._read = {}
        self._takes_mesh_colours, self._all_repeat, self._wants_number = True, False, False
        self.is_volume = False  # and no surface
        self._sees = sees

    def material(self) -> Material:
        """The core material; never silently black."""
        made = self._seen_so()
        for sees, combined in (("back", two_sided), ("shadow rays", as_shadow_rays_see)):
            if sees in self._notes.asked:
                reading = MaterialReading(self.blender_material, self._images, self._told, sees)
                made = combined(made, reading._seen_so(), self.say)
                self.guessed |= reading.guessed
                self._notes.add(reading._notes)
        return made

    def _seen_so(self) -> Material:
        surface = self._surface()
        if len(self._notes.coordinates) > 1 and any(
            isinstance(kind, MeshColours | ObjectColours) for kind in self._notes.coordinates
        ):
            # a triangle has one place in textures: its image's
            self._takes_mesh_colours, self._notes, self._read, self.guessed = False, Notes(), {}, {}
            surface = self._surface()
        if len(self._notes.coordinates) > 1 and len(set(self._notes.coordinates.values())) == 1:
            self._all_repeat, self._notes, self._read, self.guessed = True, Notes(), {}, {}
            surface = self._surface()
            self.say("its images go on in several ways beyond their edges: all are repeated there")
        surface, is_dimmed = surface.without_gain()
        if is_dimmed:
            self.say("its shaders send on more light than they get: they are dimmed")
        reflectance, translucence = surface.of_the_rest(surface.reflectance), surface.of_the_rest(surface.translucence)
        if max(reflectance.largest, translucence.largest) > 1.01:
            self.say("it reflects one colour and passes another: some of what it reflects is lost")
        reflectance, translucence = reflectance.within(1.0), translucence.within(1.0)
        if min(surface.radiance.value) < 0:
            self.say("its emission is below 0: none is taken")
        if not getattr(self.blender_material, "use_transparent_shadow", True) and surface.transmittance.largest > 0:
            self.say("lamps shine through it although its Transparent Shadows are off")
        radiance, transmittance = surface.radiance.within(BRIGHTEST), surface.transmittance.within(1.0)
        return Material(
            self.blender_material.name,
            tuple(float(x) for x in reflectance.value),
            reflectance.texture,
            tuple(float(x) for x in radiance.value),
            radiance.texture,
            tuple(float(x) for x in transmittance.value),
            transmittance.texture,
            tuple(float(x) for x in translucence.value),
            translucence.texture,
            textures_extend=self.coordinates().extends,
        )

    def coordinates(self) -> Coordinates | MeshColours | ObjectColours:
        """The coordinates of the first image; a second kind is named."""
        kinds = list(self._notes.coordinates)
        if len(kinds) > 1:
            self.say("its images use different coordinates: those of the first are used for all")
        return kinds[0] if kinds else Coordinates()

    def sentences(self) -> list[str]:
        """For the report."""
        return list(self._notes.sentences | self._notes.guesses)

    def _surface(self) -> Surface:
        if not self.blender_material.use_nodes or self.blender_material.node_tree is None:
            return Surface(self._viewport_colour())
        try:
            shader = surface_shader(self.blender_material.node_tree)
            self._say_what_is_not_baked()
            self.is_volume = shader is None and self._has("Volume")
            if shader is None:
                return NOTHING if self.is_volume else Surface()
            return self._shader(shader)
        except Unreadable as error:
            self._notes = Notes()
            self.say(f"its {error} cannot be read: the viewport colour is used")
            return Surface(self._viewport_colour())

    def _has(self, output_name):
        return output_input(self.blender_material.node_tree, output_name) is not None

    def _say_what_is_not_baked(self):
        if self._has("Volume"):
            self.say("its volume is not baked: light passes as if there were none")
        if self._has("Displacement") and self.blender_material.displacement_method != "BUMP":
            self.say("its displacement is not baked")

    def _shader(self, reached: Reached) -> Surface:
        if reached.is_constant:
            return Surface()  # an unlinked shader input is black, as Cycles has it
        kind = reached.node.type
        if kind == "BSDF_PRINCIPLED":
            return self._principled(reached)
        if kind == "EMISSION":
            return Surface(radiance=self._emitted(reached, "Color", "Strength"))
        if kind in DIFFUSE:
            return Surface(self._colour(reached, DIFFUSE[kind]).within(1.0))
        if kind in VELVET:
            colour = self._colour(reached, VELVET[kind]).within(1.0)
            return Surface(colour.scaled(np.interp(self._amount(reached, "Roughness").mean[0], *SHEEN)))
        if kind in GLOSSY:
            self.say(f"its {reached.node.bl_label} is baked as diffuse")
            metal = conductor_colour(reached.node)
            if metal is not None:
                return Surface(Colour(metal).within(1.0))
            return Surface(self._colour(reached, GLOSSY[kind]).within(1.0))
        if kind in PASSING:
            return Surface(transmittance=self._colour(reached, "Color").within(1.0))
        if kind in TRANSLUCENT:
            return Surface(translucence=self._colour(reached, TRANSLUCENT[kind]).within(1.0))
        if kind == "MIX_SHADER":
            factor = self._mix_factor(reached)
            return self._sum(((rest_of(factor), reached.feeding(1)), (factor, reached.feeding(2))))
        if kind == "ADD_SHADER":
            return self._sum(((ALL, reached.feeding(0)), (ALL, reached.feeding(1))))
        if kind == "HOLDOUT":
            return Surface()
        raise Unreadable(f"{reached.node.bl_label} node")

    def _sum(self, parts) -> Surface:
        return weighted_sum([(weight, self._shader(reached)) for weight, reached in parts if not weight.is_black])

    def _principled(self, reached) -> Surface:
        base = self._colour(reached, "Base Color").within(1.0)
        coat = self._coat(reached)  # after the colour, whose image says where textures lie
        base = base.times(coat)
        metallic = reached.feeding("Metallic")
        if not metallic.is_constant or constant(metallic) > 0:  # how much of it is metal no map need be read for
            self.say("its metal is baked as diffuse")
        passing = pointwise(lambda share: np.clip(share, 0, 1), self._amount(reached, "Transmission Weight"))
        radiance = self._emitted(reached, "Emission Color", "Emission Strength").times(coat)
        # each of a pane's two faces takes its root, so that the pane has the colour
        surface = Surface(base.times(rest_of(passing)), radiance, pointwise(np.sqrt, base).times(passing))
        surface = self._below_sheen(reached, surface)
        alpha = self._alpha(reached)
        return surface if alpha.is_white else weighted_sum([(alpha, surface), (rest_of(alpha), NOTHING)])

    def _coat(self, reached) -> Colour:
        """What a tinted coat lets through, 1 where there is none: Cycles takes its tint to the power of the way
        through it, once."""
        tint = self._colour(reached, "Coat Tint").within(1.0)
        weight = ALL if tint.is_white else self._amount(reached, "Coat Weight")
        if tint.is_white or weight.is_black:
            return ALL
        return pointwise(lambda share, t: 1 + np.clip(share, 0, 1) * (t**COAT_DEPTH - 1), weight, tint)

    def _below_sheen(self, reached, surface: Surface) -> Surface:
        """The surface under its sheen, of which is left what that does not reflect."""
        weight = self._amount(reached, "Sheen Weight")
        if weight.is_black:
            return surface
        share = weight.scaled(np.interp(self._amount(reached, "Sheen Roughness").mean[0], *SHEEN)).within(1.0)
        return weighted_sum(
            [(share, Surface(self._colour(reached, "Sheen Tint").within(1.0))), (rest_of(share), surface)]
        )

    def _alpha(self, reached) -> Colour:
        try:
            return self._as_told(reached, "Alpha", self._share, is_share=True)
        except Unreadable as error:
            self.guess(f"its alpha comes from a {error}, which cannot be read: it is baked opaque")
            return ALL

    def _emitted(self, reached, colour_name, strength_name) -> Colour:
        strength = self._amount(reached, strength_name)
        if strength.is_black:  # whatever the colour is, it need not be readable
            return Colour(np.zeros(3))
        return self._colour(reached, colour_name).times(strength)

    def _amount(self, shader, name) -> Colour:
        """A shader's input that is a number, as a grey."""
        try:
            return self._as_told(shader, name, self._grey)
        except Unreadable as error:
            value = float(shader.node.inputs[name].default_value)
            self.guess(f"its {name} comes from a {error}, which cannot be read: {value:g} is used")
            return Colour(np.full(3, value))

    def _grey(self, reached) -> Colour:
        if reached.is_constant or reached.node.type == "VALUE":
            return Colour(np.full(3, constant(reached)))
        return self.readable_number(reached)

    def _mix_factor(self, mix) -> Colour:
        try:
            return self._as_told(mix, 0, self._share, is_share=True)
        except Unreadable as error:
            if mix.feeding(0).node.type in BY_VIEW:
                self.say(f"its shaders are mixed by a {error}: the first one is used")
                return Colour(np.zeros(3))
            self.guess(f"its shaders are mixed by a {error}: they are mixed evenly")
            return Colour(np.full(3, 0.5))

    def _share(self, reached) -> Colour:
        """A grey of [0, 1]; Unreadable where there is none."""
        coordinates = dict(self._notes.coordinates)
        factor = pointwise(lambda c: np.clip(c, 0, 1), self.readable_number(reached))
        if factor.texture is not None and np.ptp(factor.texture.pixels) > EVEN:
            return factor
        self._notes.coordinates = coordinates  # what is the same all over is so wherever it is looked up
        return Colour(np.round(factor.mean, 6))  # opaque to the bit, where it is

    def factor(self, reached, usual=0.5) -> Colour:
        """A number that a colour hangs on, which may vary over the surface; ``usual`` where it cannot be read."""
        try:
            return self.readable_number(reached)
        except Unreadable as error:
            by_view = reached.node.type in BY_VIEW
            value, note = (0.0, self.say) if by_view else (usual, self.guess)
            note(f"its colour hangs on a {error}, which cannot be read: {value:g} is used for it")
            return Colour(np.full(3, value))

    def _colour(self, shader, name) -> Colour:
        try:
            return self._as_told(shader, name, self.readable_colour)
        except Unreadable as error:
            self.guess(f"its {error} cannot be read: the viewport colour is used")
            return self._viewport_colour()

    def _as_told(self, shader, name, read, is_share=False) -> Colour:
        """What ``read`` makes of a shader's input; where it has to guess, with the mean that was told, if it was."""
        reached, socket = shader.feeding(name), shader.node.inputs[name]
        place = ShaderInput(self.blender_material.original, shader.node.name, socket.identifier, is_share)
        outer, self._notes = self._notes, Notes()
        try:
            found, unreadable = read(reached), None
        except Unreadable as error:
            found, unreadable = None, error
        finally:
            inner, self._notes = self._notes, outer
        # what the view decides has no mean, and the names of nodes in groups say nothing outside
        is_guess = inner.guesses or (unreadable and reached.node.type not in BY_VIEW)
        if is_guess and any(_tells_sides_apart(node) for node in feeding(reached.node)):
            inner.asked.add("back")
        if is_guess and not shader.groups:
            self.guessed[place] = True
            if place in self._told and self._sees not in inner.asked:  # a tile shows fronts, to light that bounces
                inner.guesses = {f"its {socket.name} is what Cycles shows of it, on the mean of a square metre": True}
                found, unreadable = _with_mean(found, self._told[place]), None
        self._notes.add(inner)
        if unreadable:
            raise unreadable
        return found

    def readable_colour(self, reached) -> Colour:
        """The colour that is reached; Unreadable where it, or a node that makes it, is not known."""
        if reached.is_constant:
            return Colour(constant_colour(reached))
        key = (self._wants_number, reached.socket.as_pointer(), *(group.as_pointer() for group in reached.groups))
        if key not in self._read:
            outer, self._notes = self._notes, Notes()
            try:
                self._read[key] = self._read_colour(reached), self._notes
            except Unreadable as error:
                self._read[key] = error, Notes()
            finally:
                self._notes = outer
        found, notes = self._read[key]
        self._notes.add(notes)
        if isinstance(found, Unreadable):
            raise found
        return found

    def readable_number(self, reached) -> Colour:
        """The same as an input that is a number takes it, as a grey."""
        outer, self._wants_number = self._wants_number, True
        try:
            colour = self.readable_colour(reached)
        finally:
            self._wants_number = outer
        return mean_of_channels(colour) if getattr(reached.socket, "type", "") == "VECTOR" else grey(colour)

    def _read_colour(self, reached) -> Colour:
        if reached.node.type in {"RGB", "VALUE"}:
            return Colour(constant_colour(reached))
        if reached.node.type == "LIGHT_PATH" and reached.socket.name in KINDS_OF_RAYS:
            self._notes.asked.add("shadow rays")
            values = OF_SHADOW_RAYS if self._sees == "shadow rays" else ON_DIFFUSE_SURFACES
            return Colour(np.full(3, values.get(reached.socket.name, 0.0)))
        if reached.node.type == "NEW_GEOMETRY" and reached.socket.identifier == "Backfacing":
            self._notes.asked.add("back")
            return Colour(np.full(3, float(self._sees == "back")))
        if reached.node.type == "TEX_IMAGE":
            return self._image_colour(reached)
        if reached.node.type in SEEN_BY_ANGLE:
            mean = mean_over_view(reached)
            self.say(f"its {reached.node.bl_label} node is taken at its mean over directions, {mean:.2g}")
            return Colour(np.full(3, mean))
        if reached.node.type in COLOURS_OF_MESH:
            return self._mesh_colour(reached)
        if reached.node.type == "OBJECT_INFO":
            return self._object_colour(reached)
        return read_colour_node(reached, self)

    def _mesh_colour(self, reached) -> Colour:
        """A colour attribute's, but for those that this add-on has put there: they are light."""
        attribute = getattr(reached.node, COLOURS_OF_MESH[reached.node.type])
        is_elsewhere = getattr(reached.node, "attribute_type", "GEOMETRY") != "GEOMETRY"
        if is_elsewhere or attribute == BAKED_COLOURS or (self._wants_number and not self._takes_mesh_colours):
            raise Unreadable(f"{reached.node.bl_label} node")
        if not attribute and reached.node.type == "ATTRIBUTE":
            return Colour(np.zeros(3))  # as Cycles has it; a Color Attribute node takes the render colours
        if not self._takes_mesh_colours:
            self.say(f"its colour attribute '{attribute}' is taken as white beside an image")
            return ALL
        kind = MeshColours(attribute, is_alpha=reached.socket.identifier == "Alpha")
        self._notes.coordinates[kind] = kind
        colour = Colour(np.ones(3), self._images.of_meshes())
        if reached.socket.identifier == "Fac":  # the mean of its channels, and no luminance
            return pointwise(lambda c: np.broadcast_to(c.mean(axis=-1, keepdims=True), c.shape), colour)
        return colour

    def _object_colour(self, reached) -> Colour:
        """What differs by object, or the material's own index."""
        if reached.socket.identifier == "Material Index":
            return Colour(np.full(3, float(self.blender_material.pass_index)))
        if reached.socket.identifier not in COLOURS_OF_OBJECT or not self._takes_mesh_colours:
            raise Unreadable(f"{reached.node.bl_label} node")
        kind = ObjectColours(reached.socket.identifier)
        self._notes.coordinates[kind] = kind
        return Colour(np.ones(3), self._images.of_meshes())

    def _image_colour(self, reached) -> Colour:
        if reached.node.image is None:
            raise Unreadable("Image Texture node without an image")
        node = reached.node
        if reached.socket.identifier == "Alpha":
            texture = self._images.alpha(node.image)
        else:
            texture = self._images.texture(node.image, is_by_alpha=not node.outputs["Alpha"].is_linked)
        try:
            if node.projection != "FLAT":
                raise Unreadable(f"{node.projection.lower()} projection")
            coordinates = with_own_mapping(read_coordinates(follow(node.inputs["Vector"], reached.groups)), node)
        except Unreadable as error:
            self.say(f"its image '{node.image.name}' uses {error}: the image's mean colour is used")
            return Colour(np.array(mean_colour(texture.pixels)))
        extension = "REPEAT" if self._all_repeat else node.extension
        texture, looked_up = self._beyond_its_edges(extension, texture, coordinates)
        self._notes.coordinates[looked_up] = coordinates
        return Colour(np.ones(3), texture)

    def _beyond_its_edges(self, extension, texture, coordinates):
        """A texture and its coordinates that repeat or extend, whatever the image does beyond its edges."""
        if extension == "EXTEND":
            return texture, replace(coordinates, extends=True)
        if extension == "CLIP":
            return self._images.clipped(texture), coordinates.of_part((RIM, RIM), (1 - RIM, 1 - RIM), True)
        if extension == "MIRROR":
            return self._images.mirrored(texture), coordinates.of_part((0, 0), (0.5, 0.5), False)
        return texture, coordinates

    def _viewport_colour(self) -> Colour:
        return Colour(np.clip(np.array(self.blender_material.diffuse_color[:3], float), 0.0, 1.0))

    def say(self, sentence):
        """Note something for the report."""
        self._notes.sentences[sentence] = True

    def guess(self, sentence):
        """Note for the report what has to be guessed, unless it is told."""
        self._notes.guesses[sentence] = True


def _tells_sides_apart(node):
    return node.type == "NEW_GEOMETRY" and node.outputs["Backfacing"].is_linked


def _with_mean(colour: Colour | None, mean) -> Colour:
    """The mean (3,), varying as a colour does that was guessed from images, where one was."""
    if colour is None or colour.texture is None or not colour.mean.all():
        return Colour(mean)
    return colour.scaled(mean / colour.mean)
