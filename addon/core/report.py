"""What a bake says of itself: time, rays, error, energy, and every warning, ready for JSON."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

# what a bake costs once the file is open and has its UVs, to hold against other bakers
STAGES_OF_A_BAKE = ("read", "texels", "solve", "gather", "write")


@dataclass(frozen=True, slots=True)
class Energy:
    """Flux balance of the solve [W], summed over the channels: shot = absorbed + escaped + unshot.

    ``shot`` is the direct light that surfaces reflect: what the solver starts from.
    """

    shot: float = 0.0
    absorbed: float = 0.0
    escaped: float = 0.0
    unshot: float = 0.0


@dataclass(frozen=True, slots=True)
class Report:
    """The report of one bake.

    Attributes
    ----------
    seconds : by stage
    rays : by stage
    patches, receivers : counts; a patch has two sides, an unknown each
    method, solver : what ran, after "auto" has chosen; ``choice`` says why
    residuals : the solver's residual after each step, relative to the emitted flux
    denoiser : what took noise away in the end, with its version, or "none" and why
    estimated_error : local relative RMS error of the irradiance at the receivers, which more rays make smaller; of a
        lightmap's each by how much of the surface looks it up
    seen_error : the same at random points of the surfaces, looked up in the result as a viewer does: with the size of
        texels, or the distance of vertices, and of patches
    target_error : what was asked for
    target_reached : False when the time limit or the budget of rays came first
    energy : the solver's flux balance
    closure, reciprocity : how far transport in this scene keeps these laws (laws.Laws)
    warnings : one sentence each, with the object or material it names
    """

    seconds: dict[str, float] = field(default_factory=dict)
    rays: dict[str, int] = field(default_factory=dict)
    triangles: int = 0
    patches: int = 0
    receivers: int = 0
    lightmap_size: tuple[int, int] | None = None
    method: str = ""
    solver: str = ""
    choice: str = ""
    denoiser: str = ""
    residuals: tuple[float, ...] = ()
    estimated_error: float = 0.0
    seen_error: float = 0.0
    error_covers: str = "estimated_error: noise and smoothing at the receivers; seen_error: texel size and patches, too"
    target_error: float = 0.0
    target_reached: bool = True
    energy: Energy = field(default_factory=Energy)
    closure: float = 0.0
    reciprocity: float = 0.0
    warnings: tuple[str, ...] = ()

    def with_stages(self, seconds: dict[str, float]) -> Report:
        """A copy with further stages' seconds, and their sum over the stages of a bake as ``bake``."""
        stages = {**self.seconds, **seconds}
        stages["bake"] = sum(stages.get(stage, 0.0) for stage in STAGES_OF_A_BAKE)
        return replace(self, seconds=stages)

    def as_dict(self) -> dict:
        """Plain numbers, strings, lists and dicts."""
        fields = {name: getattr(self, name) for name in self.__slots__}
        fields["energy"] = {name: getattr(self.energy, name) for name in Energy.__slots__}
        fields["residuals"] = list(self.residuals)
        fields["warnings"] = list(self.warnings)
        fields["lightmap_size"] = list(self.lightmap_size) if self.lightmap_size else None
        return fields
