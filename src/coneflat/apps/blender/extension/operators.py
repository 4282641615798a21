"""The operators: each runs coneflat in another process, shows its progress, and ends it on Esc."""

from __future__ import annotations

import time
from collections.abc import Generator, Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

import bpy

from . import environment, exchange, meshes
from .job import Failure, Job
from .settings import COMMANDS, Preferences, own_folder, preferences

OLDEST = "4.2"
#: Seconds between looks at the process.
INTERVAL = 0.1
#: What passes to Blender while a process runs: turning the view, but no editing.
_NAVIGATION = ("MIDDLEMOUSE", "WHEEL", "TRACKPAD", "NDOF", "NUMPAD", "MOUSEMOVE", "WINDOW")
_SELECT_MODES = {"SEAMS": (False, True, False), "CONES": (True, False, False)}

Work = Generator[Job, None, None]
Result = set[str]


class Runner:
    """The part of an operator that waits for jobs; a subclass yields them from `work`.

    Attributes:
        running: the operator that is running, for the panel; there is one at most.
    """

    running: ClassVar[Runner | None] = None
    report: Any
    job: Job | None = None
    _work: Work
    _timer: Any = None

    def work(self, context: Any) -> Work:
        """Yield jobs to wait for; read meshes before and write them after.

        Raises:
            Failure: there is no result.
        """
        raise NotImplementedError

    def execute(self, context: Any) -> Result:
        """Run to the end, for scripts."""
        self._work = self.work(context)
        while (result := self.advance(context)) is None:
            time.sleep(INTERVAL / 2)
        return result

    def invoke(self, context: Any, event: Any) -> Result:
        """Start, and leave the rest to `modal`."""
        if Runner.running is not None:
            self.report({"ERROR"}, "coneflat is already running")
            return {"CANCELLED"}
        self._work = self.work(context)
        result = self.advance(context)
        if result is not None:
            return result
        Runner.running = self
        manager = context.window_manager
        self._timer = manager.event_timer_add(INTERVAL, window=context.window)
        manager.modal_handler_add(self)
        manager.progress_begin(0, 100)
        self._show(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> Result:
        """Look at the process when the timer fires, and end it on Esc."""
        if event.type == "ESC":
            self.cancel(context)
            self.report({"WARNING"}, "coneflat was stopped; nothing has changed")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"} if event.type.startswith(_NAVIGATION) else {"RUNNING_MODAL"}
        try:
            result = self.advance(context)
        except BaseException:
            self.cancel(context)
            raise
        if result is None:
            self._show(context)
            return {"PASS_THROUGH"}
        self._leave(context)
        return result

    def cancel(self, context: Any) -> None:
        """End the process; Blender also calls this when it opens another file or quits."""
        self._work.close()
        self._leave(context)

    def advance(self, context: Any) -> Result | None:
        """Go on if the process has ended; return the result of the operator, None while it runs."""
        try:
            while self.job is None or self.job.is_done:
                if self.job is not None:
                    self.job.check()
                self.job = next(self._work)
        except StopIteration:
            return {"FINISHED"}
        except Failure as failure:
            self._work.close()
            self.report({"ERROR"}, str(failure))
            return {"CANCELLED"}
        return None

    @property
    def progress(self) -> tuple[str, float]:
        """What is being done, and its completed fraction."""
        if self.job is None:
            return "", 0.0
        stage = f": {self.job.stage}" if self.job.stage else ""
        return f"{self.job.name}{stage}", self.job.fraction

    def _show(self, context: Any) -> None:
        text, fraction = self.progress
        context.window_manager.progress_update(100 * fraction)
        _set_status(context, f"{text}  {fraction:.0%}   Esc: stop")

    def _leave(self, context: Any) -> None:
        Runner.running = None
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            context.window_manager.progress_end()
        _set_status(context, None)


def _set_status(context: Any, text: str | None) -> None:
    """Show a text in the status bar, and the progress in the panels."""
    if context.workspace is not None:
        context.workspace.status_text_set(text)
    for area in context.screen.areas if context.screen is not None else ():
        area.tag_redraw()


def _install(context: Any) -> Generator[Job, None, environment.Environment]:
    """Yield the jobs that make the extension's environment, and return it."""
    folder, chosen = own_folder(), preferences(context)
    wheels = bpy.path.abspath(chosen.wheels) if chosen.wheels else ""
    commands = environment.install_commands(folder, chosen.requirement, wheels, bpy.app.online_access)
    for name, command in commands:
        with Job(name, command) as job:
            yield job
    return _find(context)


def _find(context: Any) -> environment.Environment:
    """Return the environment, and show it in the preferences.

    Raises:
        Failure: there is none.
    """
    named = preferences(context).python
    Preferences.environment, Preferences.named = None, named
    try:
        Preferences.environment = environment.find(bpy.path.abspath(named) if named else "", own_folder())
    except Failure as failure:
        Preferences.reason = str(failure)
        raise
    return Preferences.environment


def _environment(context: Any) -> Generator[Job, None, tuple[str, ...]]:
    """Return the command that runs coneflat; install it if there is none and none is named."""
    named = preferences(context).python
    current = Preferences.environment if Preferences.named == named else None
    if current is None or not Path(current.command[0]).exists():
        try:
            current = _find(context)
        except Failure:
            if named:
                raise
            current = yield from _install(context)
    return current.command


class Command(Runner):
    """An operator that runs a command of coneflat on the chosen faces.

    Attributes:
        command: the name of the command.
        title: what it does, for messages.
    """

    command: ClassVar[str]
    title: ClassVar[str]

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Return whether the operator can start."""
        return context.mode in ("OBJECT", "EDIT_MESH")

    def work(self, context: Any) -> Work:
        """Read the chosen faces, run the command, and write its result."""
        if bpy.app.version < tuple(map(int, OLDEST.split("."))):
            raise Failure(f"Blender {OLDEST} or later is needed, this is {bpy.app.version_string}")
        objects = meshes.chosen_objects(context)
        with meshes.object_mode(context) as in_edit:
            sources = self.read(context, objects, in_edit)
        command = yield from _environment(context)
        together = self.command != "quads" and context.scene.coneflat.together
        with ExitStack() as stack:
            done = []
            for chosen in [sources] if together else [[source] for source in sources]:
                folder = Path(stack.enter_context(TemporaryDirectory(prefix="coneflat-")))
                files = exchange.write_parts(folder, [source.part for source in chosen])
                arguments = [*command, self.command, *files, *self.arguments(context)]
                yield stack.enter_context(Job(self.title, arguments, folder))
                done.append((folder, chosen))
            # Nothing changes before all processes have ended well, and all results are read and can be written.
            with meshes.object_mode(context, returns=self.command != "quads"):
                results = [self.load(context, folder, chosen) for folder, chosen in done]
                for (_, chosen), result in zip(done, results, strict=True):
                    self.write(context, chosen, result)

    def uv_map(self, context: Any) -> str:
        """Return the UV map to write: that of the settings, or else one for lightmaps; "" for the active one."""
        settings = context.scene.coneflat
        is_lightmap = getattr(getattr(settings, self.command), "lightmap", 0) > 0
        return str(settings.uv_map or (meshes.LIGHTMAP if is_lightmap else ""))

    def arguments(self, context: Any) -> list[str]:
        """Return the options of the command that the settings change."""
        group = getattr(context.scene.coneflat, self.command)
        records = COMMANDS[self.command]
        return exchange.arguments(
            records, {record["name"]: getattr(group, record["name"]) for record in records}
        )

    def read(self, context: Any, objects: Sequence[Any], in_edit: bool) -> list[meshes.Source]:
        """Return the faces of objects, in object mode.

        Raises:
            Failure: there are none, or no object has a vertex group that an option names.
        """
        settings = context.scene.coneflat
        group = getattr(settings, self.command)
        records = [(entry, getattr(group, entry["name"])) for entry in COMMANDS[self.command]]
        named = [(entry, name) for entry, name in records if exchange.names_group(entry, name)]
        groups = {entry["name"]: (name, entry["kind"]) for entry, name in named}
        names = ", ".join(entry.name for entry in objects)
        for name, _ in groups.values():
            if not any(name in entry.vertex_groups for entry in objects):
                raise Failure(f"there is no vertex group {name!r} in {names}")
        is_quads = self.command == "quads"
        applied = is_quads and not in_edit and settings.modifiers
        sources = []
        for entry in objects:
            if not is_quads:
                meshes.check_uv_map(entry, self.uv_map(context))
            self._say(meshes.left_as_is(entry, applied))
            marks = {"marks": settings.marks, "sharp": settings.sharp} if not is_quads else {}
            mesh = entry.data
            if applied:
                mesh = entry.evaluated_get(context.evaluated_depsgraph_get()).to_mesh()
            source = meshes.read_source(entry, mesh, selected=in_edit, groups=groups, **marks)
            sources += [source] if source is not None else []
        if not sources:
            raise Failure("no faces are selected" if in_edit else "the selected objects have no faces")
        for option, (name, kind) in groups.items():
            if kind == "vertices" and not any(len(entry.part.lists.get(option, ())) for entry in sources):
                raise Failure(f"the vertex group {name!r} has no vertices of the chosen faces of {names}")
        return sources

    def load(self, context: Any, folder: Path, sources: Sequence[meshes.Source]) -> Any:
        """Return the result of a command.

        Raises:
            Failure: it cannot be read, or not be written to the objects.
        """
        for source in sources:
            meshes.check_uv_map(meshes.item_of(source), self.uv_map(context))
        return exchange.read_maps(folder, [source.part for source in sources])

    def write(self, context: Any, sources: Sequence[meshes.Source], result: Any) -> None:
        """Write UVs, and report measures and notes."""
        settings = context.scene.coneflat
        maps, measures = result
        for source, layout in zip(sources, maps, strict=True):
            meshes.write_map(source, layout, self.uv_map(context), mark=settings.mark, select=settings.select)
            if layout.torn:
                said = f"{source.name}: faces that seams divide, so that they need to be triangulated: {layout.torn}"
                self.report({"WARNING"}, said)
        if settings.select != "NONE":
            context.tool_settings.mesh_select_mode = _SELECT_MODES[settings.select]
        self._say(measures["notes"])
        shown = {name: measures[name] for name in ("charts", "cones", "flipped")}
        shown |= {"energy": f"{measures['energy']:.3f}", "QC": f"{measures['qc_mean']:.3f}"}
        shown |= {"seam length": f"{measures['seam_length']:.2f}"}
        names = ", ".join(source.name for source in sources)
        self._say([f"{names}: {', '.join(f'{name} {value}' for name, value in shown.items())}"])

    def _say(self, lines: Sequence[str]) -> None:
        for line in lines:
            self.report({"INFO"}, line)


class CONEFLAT_OT_unwrap(Command, bpy.types.Operator):
    """Unwrap for textures: nearly isometric UVs, with short seams and without overlaps"""

    bl_idname, bl_label, bl_options = "coneflat.unwrap", "Unwrap (textures)", {"UNDO"}
    command, title = "unwrap", "Unwrap"


class CONEFLAT_OT_flatten(Command, bpy.types.Operator):
    """Flatten conformally: UVs that preserve angles, with automatic cones"""

    bl_idname, bl_label, bl_options = "coneflat.flatten", "Flatten (conformal)", {"UNDO"}
    command, title = "flatten", "Flatten"


class CONEFLAT_OT_quads(Command, bpy.types.Operator):
    """Make a new object of quads only, with few irregular vertices"""

    bl_idname, bl_label, bl_options = "coneflat.quads", "Quads", {"UNDO"}
    command, title = "quads", "Quads"

    def load(self, context: Any, folder: Path, sources: Sequence[meshes.Source]) -> Any:
        """Return the quads of a mesh, and notes."""
        meshes.item_of(sources[0], is_same=False)
        return exchange.read_quads(folder)

    def write(self, context: Any, sources: Sequence[meshes.Source], result: Any) -> None:
        """Add an object, select it, and hide that of the mesh, which is in the same place."""
        (source,), (result_of_quads, notes) = sources, result
        added = meshes.add_quads(source, result_of_quads, context.scene.coneflat.select == "CONES")
        bpy.data.objects[source.name].hide_set(True)  # which also deselects it
        added.select_set(True)
        context.view_layer.objects.active = added
        self._say(notes)
        quads, irregular = len(result_of_quads["quads"]), len(result_of_quads["irregular"])
        self._say([f"{added.name}: {quads:,} quads, {irregular} irregular vertices"])


class CONEFLAT_OT_install(Runner, bpy.types.Operator):
    """Make the extension's own Python environment, with coneflat"""

    bl_idname, bl_label = "coneflat.install", "Install"

    def work(self, context: Any) -> Work:
        """Make the environment."""
        installed = yield from _install(context)
        self.report({"INFO"}, f"installed: {installed}")


class CONEFLAT_OT_check(bpy.types.Operator):
    """Look for coneflat: the Python above, the extension's own environment, the PATH"""

    bl_idname, bl_label = "coneflat.check", "Check"

    def execute(self, context: Any) -> Result:
        """Find the environment and report it."""
        try:
            self.report({"INFO"}, str(_find(context)))
        except Failure as failure:
            self.report({"ERROR"}, str(failure))
            return {"CANCELLED"}
        return {"FINISHED"}


COMMAND_OPERATORS = (CONEFLAT_OT_unwrap, CONEFLAT_OT_flatten, CONEFLAT_OT_quads)
OPERATORS = (*COMMAND_OPERATORS, CONEFLAT_OT_install, CONEFLAT_OT_check)
