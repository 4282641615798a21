"""Sessions: a mesh, the choices for it, and the resulting layout, independent of the web server."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from subprocess import Popen
from types import MappingProxyType
from typing import Any, NamedTuple

from ... import ConeflatError
from ...base import short_repr
from ...errors import MeshFileError, StudioError
from ...io import read_joined
from ...options import as_integer
from .choices import Choices
from .lock import ProjectLock, lock_path
from .messages import command_line, misplaced_warning, python_lines
from .outputs import MAX_QUADS, QUAD_FORMATS, RESULT_FILES, curve_options
from .places import Places, Shape, shape_received
from .project import Project, file_within, is_changed, open_project, project_path, unused_name
from .steps import STEPS, STEPS_ON_CONES, History
from .worker import Head, SentPictures, Worker

PATIENCE = 600.0  # Seconds that exports wait for the current flattening.


class _Shown(NamedTuple):
    """What is shown: page data, cones, seconds per stage, warnings, the job, whether there is no layout, and notes.

    These are on values of controls that are not met, by their option.
    """

    shown: tuple[Head, bytes] | None = None
    cones: Sequence[int] = ()
    seconds: Mapping[str, float] = MappingProxyType({})
    warnings: Sequence[str] = ()
    job: int = 0
    is_bare: bool = False
    on_controls: Mapping[str, str] = MappingProxyType({})


class Session:
    """The state of the studio. All methods are thread-safe.

    Attributes:
        folder: folder of the projects and of the files that the page can open.
        version: number of events so far; the state of a version does not change.
        layout: unique number of the layout that was shown last.
        is_early: whether that is a preview, which the final layout will replace.
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
        self._address = address
        self._look = {"color": color, "most": most_triangles}
        self.folder = folder.resolve()
        self.version = self.layout = 0
        self.is_early = False
        self.project_file: Path | None = None
        self._mesh: Path | None = None
        self._sha256 = ""
        self._lock: ProjectLock | None = None
        self._revision = ""  # Of the project file when it was read or written last.
        self._project_notes: tuple[str, ...] = ()
        # Notes on the file that was saved last, and the number of the layout that it contains.
        self._saved_notes: tuple[int, tuple[str, ...]] = 0, ()
        self._shape: Shape | None = (
            None  # Of the mesh, once the worker has read it; until then, places are those opened.
        )
        self._places: Places | None = None
        self._history = History(Choices())
        # Number of meshes and projects opened so far, and that of the last one that was repaired automatically.
        self._opened = self._repaired = 0
        # Number of the current choices, which increases with every change; 0 is never used.
        self._chosen = 1
        self._job = self._requests = 0
        self._busy: dict[str, Any] | None = None
        self._trouble: dict[str, Any] | None = None
        self._current = _Shown()
        self._cached_texts: tuple[int, tuple[str, ...], dict[str, str]] = 0, (), {}
        self._sent = SentPictures()
        self._last: _Shown | None = None  # The last final layout, while a preview is shown.
        self._answers: dict[int, tuple[Head, bytes]] = {}
        self._curves: dict[tuple[str, str], dict[str, Any]] = {}
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
        with self._changed, self._locked(project_path(path, self.folder)) as file:
            self._begin(open_project(path, file), file)

    def open_named(self, name: str) -> None:
        """Open a mesh or a project in the folder of the session.

        Raises:
            StudioError: there is no such file in the folder.
            MeshFileError, ProjectError: as in `open`.
        """
        path = file_within(name, self.folder)
        with self._changed, self._locked(project_path(path, self.folder)) as file:
            project = open_project(path, file, within=self.folder)
            read_joined(project.mesh)  # What is shown is replaced only by a mesh that can be read.
            self._begin(project, file)

    @contextmanager
    def _locked(self, file: Path) -> Iterator[Path]:
        """Yield a project file, which is locked; it replaces the one that was open unless the block fails.

        Raises:
            ProjectError: another studio has the project open.
        """
        lock, before = self._lock, self._lock
        if before is None or lock_path(before.project) != lock_path(file):
            lock = ProjectLock(file, self._address)
        try:
            yield file
        except BaseException:
            if lock is not None and lock is not before:
                lock.release()
            raise
        self._lock = lock
        if before is not None and before is not lock:
            before.release()

    def _begin(self, project: Project, file: Path) -> None:
        self._mesh, self._sha256, self.project_file = project.mesh.resolve(), project.sha256, file
        self._revision, self._project_notes = project.revision, project.notes
        self._shape, self._places = None, project.places
        self._history = History(project.choices)
        self._opened += 1
        self._chosen += 1
        self._current = _Shown(seconds=self._current.seconds)
        self.is_early, self._last = False, None
        self._flatten()

    # Actions of the user.

    def act(self, action: Mapping[str, Any]) -> None:
        """Perform an action of the user.

        Args:
            action: its key `do` is "set" for an option (`name`, `value`); "hand" to place the cones by hand; "add",
                "move", "remove", "angle" or "lock" for a cone (`vertex`; `to`, `degrees`, `locked`); "cut" or "keep"
                for a `path`; "erase" for an `edge`; "paint" for a `layer` (`where`; `weight`); "corner" to add or
                remove a corner (`vertex`); "units" for units of length (`of_file`, `shown`); "texture" for a map for a
                texture or for a conformal one (`value`); "undo", "redo", or "again" to flatten again. Actions of one
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
                try:
                    chosen = STEPS[str(kind)](history.now, action, self._current.cones)
                except (KeyError, TypeError) as error:
                    raise StudioError(f"the action {short_repr(dict(action))} is not valid") from error
                self._take_step(chosen, action.get("stroke"))

    def choose(self, plain: Mapping[str, Any]) -> None:
        """Replace all choices; plain: as returned by `Choices.as_plain`.

        Raises:
            StudioError: a choice is not valid, or no mesh is open.
            OptionError: an option is not valid, or cannot be combined with others.
        """
        with self._changed:
            self._require_mesh()
            try:
                chosen = Choices.from_plain({**Choices().as_plain(), **plain})
            except ConeflatError:
                raise
            except (KeyError, TypeError, ValueError, AttributeError) as error:
                raise StudioError(f"expected choices, got {short_repr(dict(plain))}") from error
            self._take_step(chosen, None)

    def _require_mesh(self) -> None:
        if self._mesh is None:
            raise StudioError("no mesh is open: drop one on the page, or run coneflat studio MESH")

    def _require_cones(self, kind: str) -> None:
        """Raise an error for steps on cones that the first search has not found yet."""
        is_first = self._busy is not None and (self._current.shown is None or self._current.is_bare)
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
        if self._shape is None:
            self._places = None
        if not self._history.now.flattens_like(before):
            return self._flatten()
        trouble = self._trouble
        self._save()
        self._trouble = self._trouble or trouble
        return self._notify()

    def _flatten(self) -> None:
        assert self._mesh is not None
        self._save()
        self._job += 1
        self._busy = {"stage": "", "fraction": 0.0}
        self._notify()
        is_first = self._current.shown is None
        bare = {"first": is_first, "bare": is_first or self._current.is_bare}
        self._worker.send({"do": "flatten", "job": self._job, **bare, **self._look, **self._of_mesh()})

    def _save(self) -> None:
        """Write the project file."""
        assert self._mesh is not None
        assert self.project_file is not None
        self._trouble = None
        if is_changed(self.project_file, self._revision):
            self._leave_project(self.project_file)
        try:
            chosen = self._history.now
            if self._shape is not None:
                self._places = self._shape.places(chosen.vertices())
            project = Project(self._mesh, self._sha256, chosen, self._places)
            self._revision = project.save(self.project_file)
        except MeshFileError as error:
            self._tell(f"the project is not saved: {error}", again=True)

    def _leave_project(self, file: Path) -> None:
        """Continue in a new file: another program has written the project since this session read or wrote it."""
        with self._locked(unused_name(file)) as renamed:
            self.project_file, self._revision = renamed, ""
        self._project_notes = (
            *self._project_notes,
            f"Another program has changed {file.name}, which is left as it is; choices are saved in {renamed.name}.",
        )

    def _tell(self, text: str, repair: bool = False, again: bool = False) -> None:
        """Set the error that the page shows, and whether a repair or another attempt may help."""
        self._trouble = {"text": text, "repair": repair, "again": again}

    # Results.

    @property
    def stages(self) -> dict[str, float]:
        """Return the seconds that each stage of the current layout took."""
        return dict(self._current.seconds)

    def state(self, received: int = 0) -> dict[str, Any]:
        """Return the state of the session as values for JSON.

        received: number (`chosen`) of the choices that the caller has; these are left out, because they may be large.
        """
        with self._changed:
            undo, redo = self._history.depth
            shown, project = self._current, "" if self.project_file is None else self.project_file.name
            # The layout is that of earlier choices, and no other is being computed.
            is_stale = bool(shown.shown) and not (shown.is_bare or self._busy or shown.job == self._job)
            warnings, texts = self._choice_texts(project)
            saved_job, saved_notes = self._saved_notes
            notes = () if is_stale else (*shown.warnings, *(saved_notes if saved_job == shown.job else ()))
            return {
                "version": self.version,
                "opened": self._opened,
                "mesh": None if self._mesh is None else self._mesh.name,
                "project": project,
                "chosen": self._chosen,
                "undo": undo,
                "redo": redo,
                "busy": self._busy,
                "trouble": self._trouble,
                "layout": 0 if shown.shown is None else self.layout,
                "early": self.is_early,
                "bare": shown.is_bare,
                "stale": is_stale,
                "found": list(shown.cones),
                "on_controls": {} if is_stale else dict(shown.on_controls),
                "seconds": sum(shown.seconds.values()),
                "warnings": list(dict.fromkeys((*self._project_notes, *warnings, *notes))),
                **({} if received == self._chosen else {"choices": self._history.now.as_plain(), **texts}),
            }

    def _choice_texts(self, project: str) -> tuple[tuple[str, ...], dict[str, str]]:
        """Return the warnings on the choices and the command line and the Python code, cached until the next change."""
        if self._cached_texts[0] != self._chosen:
            chosen, texts = self._history.now, {"command": "", "python": ""}
            if self._mesh is not None:
                texts["command"] = command_line(self._mesh.name, project, chosen)
                texts["python"] = python_lines(self._mesh.name, chosen)
            self._cached_texts = self._chosen, misplaced_warning(chosen), texts
        return self._cached_texts[1:]

    def picture(self, received: int = 0) -> tuple[Head, bytes] | None:
        """Return the page data of the current layout: numbers and texts, and arrays; None if there is none yet.

        received: number of the page data that the caller has; arrays that have not changed are left out.
        """
        with self._changed:
            return None if self._current.shown is None else self._sent.without(received, self._current.shown)

    def export(self, ending: str) -> bytes:
        """Return the content of a file of the result; the notes on it become warnings of the state.

        Raises:
            StudioError: there is no result, or the format is unknown.
        """
        if ending not in RESULT_FILES:
            raise StudioError(f"unknown format {short_repr(ending)}: choose from {', '.join(RESULT_FILES)}")
        return self._saved({"do": "export", "ending": ending})

    def quads(self, ending: str, count: object) -> bytes:
        """Return the content of a file of approximately `count` quads; a change of the choices cancels it.

        Raises:
            StudioError: no mesh is open, the format is unknown, or the choices were changed.
            OptionError: the number is not an integer.
        """
        if ending not in QUAD_FORMATS:
            raise StudioError(
                f"unknown format {short_repr(ending)} of quads: choose from {', '.join(QUAD_FORMATS)}"
            )
        number = as_integer("the number of quads", count)
        if not 1 <= number <= MAX_QUADS:
            raise StudioError(f"the number of quads must be from 1 to {MAX_QUADS:,}, got {number:,}")
        return self._saved({"do": "quads", "ending": ending, "count": number})

    def curve(self) -> dict[str, Any]:
        """Return the distortion for each number of cones, see `curve_data`; a change of the choices cancels it.

        Raises:
            StudioError: no mesh is open, or the choices were changed.
        """
        with self._changed:
            key = self._sha256, sha256(repr(curve_options(self._history.now)).encode()).hexdigest()
            if key not in self._curves:
                self._curves[key] = self._request({"do": "curve"})[0]
            return self._curves[key]

    def _saved(self, job: Head) -> bytes:
        """Return the content of a file that the worker makes, and store the notes on it."""
        head, content = self._request(job)
        with self._changed:
            self._saved_notes = self._current.job, tuple(head["notes"])
            self._notify()
        return content

    def _request(self, job: Head) -> tuple[Head, bytes]:
        """Return the output of a job of the worker other than a flattening."""
        with self._changed:
            self._require_mesh()
            if not self._worker.is_alive:  # Its result is lost.
                self._flatten()
            self._requests -= 1  # Negative, unlike the numbers of flattenings.
            number = self._requests
            self._answers[number] = ({}, b"")
            # Long jobs are cancelled by a later flattening.
            stops = {} if job["do"] == "export" else {"after": self._job}
            self._worker.send({**job, **stops, **self._of_mesh(), "job": number})
            self._changed.wait_for(lambda: self._answers[number][0], PATIENCE)
            head, body = self._answers[number]
            del self._answers[number]
        if "given_up" in head:
            raise StudioError("the choices have changed: try again")
        if "done" not in head:
            raise StudioError(head.get("error", "this took too long"))
        return head["done"], body

    def _of_mesh(self) -> Head:
        return {"mesh": str(self._mesh), "sha256": self._sha256, "choices": self._history.now.as_plain()}

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
            if self._lock is not None:
                self._lock.release()
            self._notify()

    # Messages of the worker.

    def _on_message(self, head: Head, body: bytes) -> None:
        with self._changed:
            if "shape" in head:
                return self._take_shape(head["shape"], body)
            if head["job"] in self._answers and "stage" not in head:
                self._answers[head["job"]] = (head, body)
                return self._changed.notify_all()
            if head["job"] != self._job:
                return None
            if "stage" in head:
                self._busy = {"stage": head["stage"], "fraction": head["fraction"]}
            elif "model" in head:
                self._show(head["model"], body, head["job"], is_bare=True)
            elif "early" in head:
                self._last = self._last or self._current
                self._show(head["early"], body, head["job"])
                self.is_early = True
            elif "error" in head:
                self._restore_layout()
                options = self._history.now.options
                mends = head.get("repair", False) and not options.get("repair")
                if mends and "repair" not in options and self._repaired != self._opened:
                    self._repaired = self._opened  # Only once: the user can undo it.
                    return self._take_step(self._history.now.with_option("repair", True), None)
                if head.get("bare"):
                    self._show(head["bare"], body, head["job"], is_bare=True)
                self._tell(head["error"], mends, head.get("again", False))
            elif "done" in head:
                self._busy = None
                self._show(head["done"], body, head["job"])
                if "missing" in head["done"] and self._trouble is None:
                    self._tell(head["done"]["missing"])
                self.is_early, self._last = False, None
            return self._notify()

    def _take_shape(self, head: Mapping[str, str], body: bytes) -> None:
        """Store the shape of the mesh, and write where the vertices of the choices are."""
        if head["sha256"] != self._sha256:
            return
        self._shape, trouble = shape_received(head, body), self._trouble
        if len(self._history.now.vertices()):
            self._save()
            self._trouble = self._trouble or trouble

    def _show(self, data: Head, body: bytes, job: int, is_bare: bool = False) -> None:
        self.layout += 1
        picture = self._sent.numbered((data["head"], body))
        self._current = _Shown(
            picture,
            data["found"],
            data["seconds"],
            data.get("warnings", ()),
            job,
            is_bare,
            data.get("on_controls", {}),
        )

    def _restore_layout(self) -> None:
        """End the current job, and show the last final layout instead of a preview."""
        self._busy = None
        if self.is_early and self._last is not None and self._last.shown is not None:
            self._current = self._last
            self.layout += 1
            self.is_early, self._last = False, None

    def _on_exit(self, how: str) -> None:
        with self._changed:
            message = f"the worker process {how}; no choices are lost: try again, or undo the last change"
            for job in self._answers:
                self._answers[job] = ({"error": message}, b"")
            self._restore_layout()
            self._tell(message, again=True)
            self._notify()

    def _notify(self) -> None:
        self.version += 1
        self._changed.notify_all()
        for listener in self._listeners:
            listener()
