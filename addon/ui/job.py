"""A bake on a thread of its own: plain arrays in, a result or an exception out, no bpy."""

from __future__ import annotations

import threading


class BakeJob:
    """Runs ``core.bake.bake``, by ``start`` beside Blender's main thread, which polls it, or by ``run`` at once.

    Attributes
    ----------
    stage, fraction : what is being done, and the share of the whole bake that is done [0..1]
    result : BakeResult once it has succeeded
    error : the exception once it has failed; BakeCancelled after ``cancel``
    """

    def __init__(self, bake, scene, settings):
        self.stage, self.fraction = "start", 0.0
        self.result = None
        self.error = None
        self._cancelled = threading.Event()
        self._call = lambda: bake(scene, settings, self._on_progress)
        self._thread = threading.Thread(target=self.run, name="patchlight bake", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def cancel(self) -> None:
        """Ask it to stop; it does so at its next step."""
        self._cancelled.set()

    def run(self) -> None:
        """Bake on the calling thread."""
        try:
            self.result = self._call()
        except BaseException as error:  # raised again by whoever asks for the result
            self.error = error

    def wait(self) -> None:
        """Return when the thread has ended, if it was started."""
        if self._thread.is_alive():
            self._thread.join()

    @property
    def is_running(self) -> bool:
        return self._thread.is_alive()

    @property
    def is_cancelled(self) -> bool:
        """Whether it was asked to stop."""
        return self._cancelled.is_set()

    def _on_progress(self, stage, fraction):
        self.stage, self.fraction = stage, fraction
        return not self._cancelled.is_set()
