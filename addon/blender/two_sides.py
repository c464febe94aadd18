"""A material whose nodes ask which side is seen, or by which rays: two readings of it, made one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..core.scene import Back, Material, Texture

REFLECTING = ("reflectance", "reflectance_texture")
GLOWING = ("radiance", "radiance_texture")
PASSING = ("transmittance", "transmittance_texture")


def two_sided(front: Material, back: Material, say) -> Material:
    """What both sides are, as far as one core Material can be it; ``say`` is told of the rest."""
    if front.is_translucent or back.is_translucent:
        say("it is translucent: its back is taken to be as its front")
        return front
    if front.is_nothing != back.is_nothing:
        return replace(front, open_side="back") if back.is_nothing else replace(back, open_side="front")
    if _differ(front, back, PASSING):
        say("light passes its back as it passes its front")
    if not _differ(front, back, (*REFLECTING, *GLOWING)):
        return front
    return replace(front, back=Back(**{name: getattr(back, name) for name in (*REFLECTING, *GLOWING)}))


def as_shadow_rays_see(lit: Material, shadowing: Material, say) -> Material:
    """The material as light that bounces sees it, and as shadow rays do: what these pass alone hides no lamp.

    Whatever of it passes some of the light is ``lit`` for both.
    """
    if lit.is_nothing != shadowing.is_nothing:
        return lit.seen_by(False, True) if shadowing.is_nothing else shadowing.seen_by(True, False)
    if _differ(lit, shadowing, PASSING):
        say("shadow rays pass it as light that bounces does")
    return lit


def _differ(one, other, names):
    return any(_is_other(getattr(one, name), getattr(other, name)) for name in names)


def _is_other(one, other):
    """Of colours, or of textures or None."""
    if isinstance(one, Texture) and isinstance(other, Texture):
        return not np.array_equal(one.pixels, other.pixels)
    return one != other
