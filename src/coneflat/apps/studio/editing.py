"""Editing: a mesh, the choices for it, and the layout of these, which a worker process computes."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from subprocess import Popen
from typing import Any

from ...errors import MeshFileError, StudioError
from ...io import read_joined
from .choices import Choices
from .messages import CachedTexts
from .opened import OpenProject
from .project import Project, file_within, open_project, project_path
from .requests import LONG_JOBS, Cancelled, Requests
from .shown import Display
from .steps import STEPS_ON_CONES, History, choices_given, step_taken
from .worker import Head, Worker

PATIENCE = 600.0  # Seconds that exports wait for the current flattening.


class Editing:
    """The part of a session that the user edits. All methods are thread-safe.

    Attributes:
        folder: folder of the projects and of the files that the page can open.
        version: number of events so far; the state of a version does not change.
    """

    def __init__(
        self,
        folder: Path,
        color: str | None = None,
        most_triangles: int | None = None,
        address: str = "",
        process: Popen[bytes] | None = None,
    ) -> None:
        """Args:
        folder: folder of projects.
        color: name of values that are shown as colours, as in `own_quantity`.
        most_triangles: largest number of triangles shown; None for the default of the viewer.
        address: address of the page, which other studios are told that open the same project.
        process: worker process that was started in advance, see `start_process`.
        """
        self._look = {"color": color, "most": most_triangles}
        self.folder = folder.resolve()
        self.version = 0
        self._project = OpenProject(address)
        self._display = Display()
        # Notes on the file that was saved last, and the number of the layout that it contains.
        self._saved_notes: tuple[int, tuple[str, ...]] = 0, ()
        self._history = History(Choices())
        # Number of meshes and projects opened so far, and that of the last one that was repaired automatically.
        self._opened = self._repaired = 0
        # Number of the current choices, which increases with every change; 0 is never used.
        self._chosen = 1
        self._job = 0
        self._busy: dict[str, Any] | None = None
        self._trouble: dict[str, Any] | None = None
        self._texts = CachedTexts()
        self._requests = Requests()
        self._changed = threading.Condition(threading.RLock())
        self._listeners: list[Callable[[], None]] = []
        self._worker = Worker(self._on_message, self._on_exit, process)

    # Meshes and projects.

    def open(self, path: Path) -> None:
        """Open a mesh, with the choices of its project in this folder if there is one; or a project.

        Raises:
            MeshFileError: the mesh cannot be read.
            ProjectError: the project cannot be read, belongs to another mesh, or is open in another studio.
        """
        with self._changed, self._project.locked(project_path(path, self.folder)) as file:
            self._begin(open_project(path, file), file)

    def open_named(self, name: str) -> None:
        """Open a mesh or a project in the folder of the session.

        Raises:
            StudioError: there is no such file in the folder.
            MeshFileError, ProjectError: as in `open`.
        """
        path = file_within(name, self.folder)
        with self._changed, self._project.locked(project_path(path, self.folder)) as file:
            project = open_project(path, file, within=self.folder)
            read_joined(project.mesh)  # What is shown is replaced only by a mesh that can be read.
            self._begin(project, file)

    def _begin(self, project: Project, file: Path) -> None:
        self._project.begin(project, file)
        self._history = History(project.choices)
        self._opened += 1
        self._chosen += 1
        self._display.clear()
        self._flatten()

    # Actions of the user.

    def act(self, action: Mapping[str, Any]) -> None:
        """Perform an action of the user.

        Args:
            action: as for `step_taken`; or its key `do` is "undo", "redo", or "again" to flatten again. Actions of one
                `stroke` are undone together.

        Raises:
            StudioError: the action is not valid, or is not possible now.
            OptionError: an option is not valid, or cannot be combined with others.
        """
        with self._changed:
            self._require_mesh()
            kind, history = action.get("do"), self._history
            if kind == "again":
                self._flatten()
            elif kind in ("undo", "redo"):
                before = history.now
                if history.undo() if kind == "undo" else history.redo():
                    self._apply_step(before)
            else:
                self._require_cones(str(kind))
                chosen = step_taken(history.now, action, self._display.current.cones)
                self._take_step(chosen, action.get("stroke"))

    def choose(self, plain: Mapping[str, Any]) -> None:
        """Replace all choices; plain: as returned by `Choices.as_plain`.

        Raises:
            StudioError: a choice is not valid, or no mesh is open.
            OptionError: an option is not valid, or cannot be combined with others.
        """
        with self._changed:
            self._require_mesh()
            self._take_step(choices_given(plain), None)

    def _require_mesh(self) -> None:
        if self._project.mesh is None:
            raise StudioError("no mesh is open: drop one on the page, or run coneflat studio MESH")

    def _require_cones(self, kind: str) -> None:
        """Raise an error for steps on cones that the first search has not found yet."""
        is_first = self._busy is not None and (
            self._display.current.picture is None or self._display.current.is_bare
        )
        chosen = self._history.now
        if kind in STEPS_ON_CONES and is_first and not (chosen.by_hand or chosen.for_texture):
            raise StudioError("the cones are not found yet: wait for the first layout")

    def _take_step(self, chosen: Choices, stroke: object) -> None:
        """Take a step if the choices differ."""
        chosen.keywords()
        before = self._history.now
        if self._history.change(chosen, stroke):
            self._apply_step(before)

    def _apply_step(self, before: Choices) -> None:
        """Save the choices after a step, and flatten if the layout depends on what has changed."""
        self._chosen += 1
        self._project.forget_places()
        if not self._history.now.flattens_like(before):
            return self._flatten()
        self._save_again()
        return self._notify()

    def _flatten(self) -> None:
        self._save()
        self._job += 1
        self._busy = {"stage": "", "fraction": 0.0}
        self._notify()
        is_first = self._display.current.picture is None
        bare = {"first": is_first, "bare": is_first or self._display.current.is_bare}
        self._worker.send({"do": "flatten", "job": self._job, **bare, **self._look, **self._of_mesh()})

    def _save(self) -> None:
        """Write the project file; errors of the last attempt are forgotten."""
        self._trouble = None
        try:
            self._project.save(self._history.now)
        except MeshFileError as error:
            self._tell(f"the project is not saved: {error}", again=True)

    def _save_again(self) -> None:
        """Write the project file where no flattening follows: an error of the last one is still true."""
        trouble = self._trouble
        self._save()
        self._trouble = self._trouble or trouble

    def _tell(self, text: str, repair: bool = False, again: bool = False) -> None:
        """Set the error that the page shows, and whether a repair or another attempt may help."""
        self._trouble = {"text": text, "repair": repair, "again": again}

    # Results.

    @property
    def project_file(self) -> Path | None:
        """Return the file of the project; None if nothing is open."""
        return self._project.file

    @property
    def stages(self) -> dict[str, float]:
        """Return the seconds that each stage of the current layout took."""
        return dict(self._display.current.seconds)

    def state(self, received: int = 0) -> dict[str, Any]:
        """Return the state of the session as values for JSON.

        received: number (`chosen`) of the choices that the caller has; these are left out, because they may be large.
        """
        with self._changed:
            undo, redo = self._history.depth
            shown, project = self._display.current, self._project
            # The layout is that of earlier choices, and no other is being computed.
            is_stale = bool(shown.picture) and not (shown.is_bare or self._busy or shown.job == self._job)
            warnings, texts = self._texts.of(self._chosen, project.mesh, project.name, self._history.now)
            saved_job, saved_notes = self._saved_notes
            notes = () if is_stale else (*shown.warnings, *(saved_notes if saved_job == shown.job else ()))
            return {
                "version": self.version,
                "opened": self._opened,
                "mesh": None if project.mesh is None else project.mesh.name,
                "project": project.name,
                "chosen": self._chosen,
                "undo": undo,
                "redo": redo,
                "busy": self._busy,
                "making": self._requests.running,
                "trouble": self._trouble,
                "layout": 0 if shown.picture is None else self._display.number,
                "early": self._display.is_early,
                "bare": shown.is_bare,
                "stale": is_stale,
                "found": list(shown.cones),
                "on_controls": {} if is_stale else dict(shown.on_controls),
                "seconds": sum(shown.seconds.values()),
                "warnings": list(dict.fromkeys((*project.notes, *warnings, *notes))),
                **({} if received == self._chosen else {"choices": self._history.now.as_plain(), **texts}),
            }

    def picture(self, received: int = 0) -> tuple[Head, bytes] | None:
        """Return the page data of the current layout: numbers and texts, and arrays; None if there is none yet.

        received: number of the page data that the caller has; arrays that have not changed are left out.
        """
        with self._changed:
            return self._display.picture(received)

    def cancel(self) -> None:
        """Cancel what is being computed: the layout, or else quads or a curve."""
        with self._changed:
            running = self._requests.running
            job = self._job if self._busy else running and running["job"]
            if job is not None:
                self._worker.send({"do": "cancel", "job": job})

    def _request(self, job: Head) -> tuple[Head, bytes]:
        """Return the output of a job of the worker other than a flattening."""
        with self._changed:
            self._require_mesh()
            if not self._worker.is_alive:  # Its result is lost.
                self._flatten()
            number = self._requests.begin(job["do"])
            # Long jobs are cancelled by a later flattening.
            is_long = job["do"] in LONG_JOBS
            stops = {"after": self._job} if is_long else {}
            self._worker.send({**job, **stops, **self._of_mesh(), "job": number})
            self._changed.wait_for(lambda: self._requests.is_answered(number), None if is_long else PATIENCE)
            head, body = self._requests.end(number)
            self._notify()
        if head.get("given_up") == "cancelled":
            raise Cancelled
        if "given_up" in head:
            raise StudioError("the choices have changed: try again")
        if "done" not in head:
            raise StudioError(head.get("error", "this took too long"))
        return head["done"], body

    def _of_mesh(self) -> Head:
        mesh, sha256 = str(self._project.mesh), self._project.sha256
        return {"mesh": mesh, "sha256": sha256, "choices": self._history.now.as_plain()}

    def listen(self, listener: Callable[[], None]) -> None:
        """Register a function that is called, from any thread, after every event."""
        self._listeners.append(listener)

    def wait_until_idle(self, seconds: float = PATIENCE) -> bool:
        """Return whether the flattening of the choices ended, or failed, within the given time."""
        with self._changed:
            return self._changed.wait_for(lambda: self._busy is None, seconds)

    def close(self) -> None:
        """End the worker process, unlock the project, and wake everyone who waits for events."""
        self._worker.end()
        with self._changed:
            self._project.release()
            self._notify()

    # Messages of the worker.

    def _on_message(self, head: Head, body: bytes) -> None:
        with self._changed:
            if "shape" in head:
                return self._take_shape(head["shape"], body)
            if self._requests.take(head, body):
                return self._notify()
            if head["job"] != self._job:
                return None
            if "stage" in head:
                self._busy = {"stage": head["stage"], "fraction": head["fraction"]}
            elif "given_up" in head:
                self._restore_layout()
                self._tell("the layout of the last change was cancelled", again=True)
            elif "model" in head:
                self._display.show_bare(head["model"], body, head["job"])
            elif "early" in head:
                self._display.show_early(head["early"], body, head["job"])
            elif "error" in head:
                self._restore_layout()
                options = self._history.now.options
                mends = head.get("repair", False) and not options.get("repair")
                if mends and "repair" not in options and self._repaired != self._opened:
                    self._repaired = self._opened  # Only once: the user can undo it.
                    return self._take_step(self._history.now.with_option("repair", True), None)
                if head.get("bare"):
                    self._display.show_bare(head["bare"], body, head["job"])
                self._tell(head["error"], mends, head.get("again", False))
            elif "done" in head:
                self._busy = None
                self._display.show_final(head["done"], body, head["job"])
                if "missing" in head["done"] and self._trouble is None:
                    self._tell(head["done"]["missing"])
            return self._notify()

    def _take_shape(self, head: Mapping[str, str], body: bytes) -> None:
        """Store the shape of the mesh, and write where the vertices of the choices are."""
        if self._project.take_shape(head, body) and len(self._history.now.vertices()):
            self._save_again()

    def _restore_layout(self) -> None:
        """End the current job, and show the last final layout instead of a preview."""
        self._busy = None
        self._display.restore()

    def _on_exit(self, how: str) -> None:
        with self._changed:
            message = f"the worker process {how}; no choices are lost: try again, or undo the last change"
            self._requests.fail(message)
            self._restore_layout()
            self._tell(message, again=True)
            self._notify()

    def _notify(self) -> None:
        self.version += 1
        self._changed.notify_all()
        for listener in self._listeners:
            listener()
