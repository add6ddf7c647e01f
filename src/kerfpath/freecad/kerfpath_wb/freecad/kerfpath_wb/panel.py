"""The task panel: progress, verdict, map, player, program, and the settings of the job.

The settings are built from the message `options`: they are declared in kerfpath alone.
"""

import json
from base64 import b64decode
from html import escape

import FreeCADGui as Gui
from PySide import QtCore, QtGui

try:
    from PySide import QtWidgets
except ImportError:  # FreeCAD 0.20 and 0.21 have them all in QtGui
    QtWidgets = QtGui

from . import objects, tr
from .process import ProcessError

GOOD, BAD, WAIT = "#2e7d32", "#c62828", "#8a6d00"
MAP_HEIGHT = 150
STEPS = 1000
"""Steps of the slider of the time."""


class PoseMap(QtWidgets.QWidget):
    """The map of a contour: nodes to the right, rotation about the beam upwards."""

    clicked = QtCore.Signal(int)  # a node

    def __init__(self):
        super().__init__()
        self.setMinimumHeight(MAP_HEIGHT)
        self.setToolTip(
            tr("Rotations about the beam along the cut: why they are lost, and the chosen one")
        )
        self._image, self._course, self._nodes, self._gamma, self._node = None, [], 0, [], None
        self.codes = b""

    def show_map(self, message, posture):
        """Show the layer of a posture."""
        layer = next(each for each in message["layers"] if each["posture"] == posture)
        K, gamma = message["nodes"], message["gamma"]
        # Kept beside the image, which does not copy it.
        self.codes = b64decode(layer["codes"])
        image = QtGui.QImage(self.codes, len(gamma), K, len(gamma), QtGui.QImage.Format_Indexed8)
        colours = [QtGui.QColor(colour).rgb() for colour in message["colours"]]
        image.setColorTable(colours + [0] * (256 - len(colours)))
        self._image = image.transformed(QtGui.QTransform().rotate(-90))
        self._nodes, self._gamma, s = K, gamma, message["s"]
        self._course = []
        for course in message["course"]:
            at, points = 0, []
            for place, angle, own in zip(course["s"], course["gamma"], course["posture"]):
                while at + 1 < K and s[at] < place - 1e-9:
                    at += 1
                points.append((at, angle) if own == posture else None)
            self._course.append(points)
        self.update()

    def show_node(self, node):
        """Show the cursor at a node; None: nowhere."""
        if node != self._node:
            self._node = node
            self.update()

    def paintEvent(self, event):
        painter = QtGui.QPainter(self)
        painter.fillRect(self.rect(), QtGui.QColor("#dddddd"))
        if self._image is None:
            return
        painter.drawImage(self.rect(), self._image)
        painter.setRenderHint(QtGui.QPainter.Antialiasing)
        low, high = self._gamma[0], self._gamma[-1]

        def place(node, angle):
            turn = (angle - low) % 6.283185307179586
            x = (node + 0.5) / self._nodes * self.width()
            return QtCore.QPointF(x, (1 - turn / max(high - low, 1e-9)) * self.height())

        for width, colour in ((4.0, "#ffffff"), (2.0, "#000000")):
            painter.setPen(QtGui.QPen(QtGui.QColor(colour), width))
            for course in self._course:
                for one, two in zip(course, course[1:]):
                    if one and two:
                        a, b = place(*one), place(*two)
                        if abs(a.y() - b.y()) < self.height() / 2:
                            painter.drawLine(a, b)
        if self._node is not None:
            x = (self._node + 0.5) / self._nodes * self.width()
            painter.setPen(QtGui.QPen(QtGui.QColor("#ee5500"), 2.0))
            painter.drawLine(QtCore.QPointF(x, 0), QtCore.QPointF(x, self.height()))

    def mousePressEvent(self, event):
        if self._nodes:
            node = int(event.pos().x() / max(self.width(), 1) * self._nodes)
            self.clicked.emit(min(max(node, 0), self._nodes - 1))


class Settings(QtWidgets.QWidget):
    """All settings of the job, in groups, as the process declares them."""

    def __init__(self, session):
        super().__init__()
        self._session, self._built = session, None
        self.group, self.contour = QtWidgets.QComboBox(), QtWidgets.QComboBox()
        self._area = QtWidgets.QScrollArea()
        self._area.setWidgetResizable(True)
        rows = QtWidgets.QVBoxLayout(self)
        rows.setContentsMargins(4, 4, 4, 4)
        for each in (self.group, self.contour, self._area):
            rows.addWidget(each)
        self.group.currentIndexChanged.connect(self.build)
        self.contour.currentIndexChanged.connect(self.build)

    def refresh(self):
        """Take new options or values."""
        session = self._session
        if session.options is None or session.values is None:
            return
        titles = [each["title"] for each in session.options["groups"] if each["fields"]]
        names = [t.get("name") or t.get("pick") or "?" for t in session.values["contour"]]
        for box, texts in ((self.group, titles), (self.contour, names)):
            if [box.itemText(i) for i in range(box.count())] != texts:
                at = max(box.currentIndex(), 0)
                box.blockSignals(True)
                box.clear()
                box.addItems(texts)
                box.setCurrentIndex(min(at, len(texts) - 1))
                box.blockSignals(False)
                self._built = None
        if self._built != session.text:
            self.build()

    def build(self, *_):
        """Build the controls of the chosen group."""
        session = self._session
        if session.options is None or session.values is None:
            return
        groups = [each for each in session.options["groups"] if each["fields"]]
        group = groups[max(self.group.currentIndex(), 0)]
        self.contour.setVisible(group["contour"])
        inner = QtWidgets.QWidget()
        form = QtWidgets.QFormLayout(inner)
        form.setRowWrapPolicy(QtWidgets.QFormLayout.WrapAllRows)
        for field in group["fields"]:
            needs = field["needs"]
            if needs is None or self._value(needs) is not None:
                control = self._control(field)
                control.setToolTip("{}\n{}".format(field["help"], field["key"]).strip())
                unit = " ({})".format(field["unit"]) if field["unit"] else ""
                label = QtWidgets.QLabel(field["label"] + unit)
                label.setWordWrap(True)
                form.addRow(label, control)
        self._area.setWidget(inner)
        self._built = session.text

    def _index(self):
        return max(self.contour.currentIndex(), 0)

    def _value(self, key):
        return self._session.value(key, self._index())

    def _control(self, field):
        key, kind, value = field["key"], field["kind"], self._value(field["key"])
        if kind in ("switch", "table"):
            control = QtWidgets.QCheckBox()
            control.setChecked(value not in (None, False))
            yes, no = ({}, None) if kind == "table" else (True, False)
            control.clicked.connect(lambda on: self._set(field, yes if on else no))
        elif kind == "choice":
            control = QtWidgets.QComboBox()
            default = "default ({})".format(field["default"]) if field["default"] else "default"
            control.addItems(([] if field["required"] else [default]) + field["choices"])
            if value in field["choices"]:
                control.setCurrentText(value)
            control.activated.connect(
                lambda at: self._set(
                    field,
                    control.itemText(at) if control.itemText(at) in field["choices"] else None,
                )
            )
        else:
            control = QtWidgets.QLineEdit("" if value is None else _shown(value))
            if field["default"] is not None:
                control.setPlaceholderText(_shown(field["default"]))
            before = control.text()

            def done():
                text = control.text().strip()
                if text != before:
                    self._set(field, _read(text))

            control.editingFinished.connect(done)
        control.setObjectName(key)
        return control

    def _set(self, field, value):
        session, index = self._session, self._index()
        changes = [(session.path(field["key"], index), value)]
        other = field["companion"]
        if other and (value is None or self._value(other["key"]) is None):
            to = None if value is None else other["value"]
            if to is not None or self._value(other["key"]) is not None:
                changes.append((session.path(other["key"], index), to))
        session.edit(field["label"], changes)


def _shown(value):
    return value if isinstance(value, str) else json.dumps(value)


def _read(text):
    """Return the value that somebody has typed; kerfpath refuses what is none."""
    if not text:
        return None
    try:
        return json.loads(text)
    except ValueError:
        return text


class Panel:
    """The task panel of the job of a document.

    Parameters
    ----------
    session : Session
    """

    def __init__(self, session):
        self.session, self._layers = session, None
        self.form = QtWidgets.QWidget()
        self.form.setWindowTitle(tr("Kerfpath"))
        self.form.setWindowIcon(QtGui.QIcon(objects.icon("kerfpath")))
        tabs = QtWidgets.QTabWidget()
        self.settings = Settings(session)
        tabs.addTab(self._cut_tab(), tr("Cut"))
        tabs.addTab(self.settings, tr("All settings"))
        outer = QtWidgets.QVBoxLayout(self.form)
        outer.setContentsMargins(0, 0, 0, 0)
        outer.addWidget(tabs)
        session.heard.connect(self._heard)
        session.shown.connect(self._moment)
        self.refresh()

    # What FreeCAD asks.

    def getStandardButtons(self):
        buttons = QtWidgets.QDialogButtonBox.Close
        return int(getattr(buttons, "value", buttons))

    def isAllowedAlterDocument(self):
        return True

    isAllowedAlterSelection = isAllowedAlterView = isAllowedAlterDocument

    def reject(self):
        self._leave()
        self.session.close()
        return True

    accept = reject

    def _leave(self):
        for signal, slot in ((self.session.heard, self._heard), (self.session.shown, self._moment)):
            try:
                signal.disconnect(slot)
            except (RuntimeError, TypeError):
                pass  # left already
        if Gui.Control.activeDialog():
            Gui.Control.closeDialog()

    # The tab of the cut.

    def _cut_tab(self):
        page = QtWidgets.QWidget()
        rows = QtWidgets.QVBoxLayout(page)
        rows.setContentsMargins(6, 6, 6, 6)
        self.status, self.bar = QtWidgets.QLabel(), QtWidgets.QProgressBar()
        self.status.setWordWrap(True)
        self.bar.setTextVisible(False)
        self.bar.setMaximumHeight(8)
        self.stop = QtWidgets.QPushButton(tr("Stop"))
        self.stop.clicked.connect(self._stop_or_plan)
        line = QtWidgets.QHBoxLayout()
        line.addWidget(self.status, 1)
        line.addWidget(self.stop)
        rows.addLayout(line)
        rows.addWidget(self.bar)
        self.verdict = QtWidgets.QLabel()
        self.verdict.setWordWrap(True)
        self.verdict.setTextInteractionFlags(QtCore.Qt.TextSelectableByMouse)
        rows.addWidget(self.verdict)
        self.remedies = QtWidgets.QLabel()
        self.remedies.setWordWrap(True)
        self.remedies.setToolTip(tr("Change the job so that there is a path"))
        self.remedies.linkActivated.connect(lambda number: self._offers[int(number)][1]())
        rows.addWidget(self.remedies)
        form = QtWidgets.QFormLayout()
        self.speed = QtWidgets.QDoubleSpinBox()
        self.speed.setRange(0.01, 1000)
        self.speed.setDecimals(2)
        self.speed.setSuffix(" m/min")
        self.speed.setKeyboardTracking(False)
        self.speed.valueChanged.connect(self._speed)
        self.robot, self.head, self.language = (QtWidgets.QComboBox() for _ in range(3))
        for box in (self.robot, self.head, self.language):
            box.setSizeAdjustPolicy(QtWidgets.QComboBox.AdjustToMinimumContentsLengthWithIcon)
            box.setMinimumContentsLength(12)
        self.robot.activated.connect(lambda i: self.session.choose_robot(self.robot.itemData(i)))
        self.head.activated.connect(self._mount)
        self.language.activated.connect(self._speak)
        for label, control in (
            (tr("Speed"), self.speed),
            (tr("Robot"), self.robot),
            (tr("Head"), self.head),
            (tr("Language"), self.language),
        ):
            form.addRow(label, control)
        rows.addLayout(form)
        self.contour, self.posture = QtWidgets.QComboBox(), QtWidgets.QComboBox()
        self.contour.activated.connect(self._choose)
        self.posture.activated.connect(lambda i: self._draw_map())
        line = QtWidgets.QHBoxLayout()
        line.addWidget(self.contour, 1)
        line.addWidget(self.posture, 1)
        rows.addLayout(line)
        self.map = PoseMap()
        self.map.clicked.connect(self._go_to)
        rows.addWidget(self.map, 1)
        self.legend = QtWidgets.QLabel()
        self.legend.setWordWrap(True)
        rows.addWidget(self.legend)
        self.play, self.time = QtWidgets.QPushButton(tr("Play")), QtWidgets.QLabel()
        self.slider = QtWidgets.QSlider(QtCore.Qt.Horizontal)
        self.slider.setRange(0, STEPS)
        self.slider.sliderMoved.connect(
            lambda at: self.session.seek(at / STEPS * self.session.timeline.total)
        )
        self.play.clicked.connect(lambda: self.session.play(not self.session.playing))
        line = QtWidgets.QHBoxLayout()
        for control, share in ((self.play, 0), (self.slider, 1), (self.time, 0)):
            line.addWidget(control, share)
        rows.addLayout(line)
        self.write = QtWidgets.QPushButton(tr("Write the program"))
        self.folder = QtWidgets.QPushButton("…")
        self.folder.setMaximumWidth(32)
        self.folder.setToolTip(tr("Choose the folder of the program"))
        self.write.clicked.connect(self._write)
        self.folder.clicked.connect(self._choose_folder)
        line = QtWidgets.QHBoxLayout()
        line.addWidget(self.write, 1)
        line.addWidget(self.folder)
        rows.addLayout(line)
        self.written = QtWidgets.QLabel()
        self.written.setWordWrap(True)
        rows.addWidget(self.written)
        return page

    # What the user does.

    def _stop_or_plan(self):
        session = self.session
        if session.studio is None:
            try:
                session.start()
            except ProcessError as error:
                session._say(str(error))
        else:
            session.problem = ""
            session.ask("cancel" if session.progress["busy"] else "plan")
        self.refresh()

    def _speed(self, value):
        tables = (self.session.values or {}).get("contour", [])
        self.session.problem = ""
        self.session.edit(
            tr("Speed"),
            [(["contour", i, "speed_m_min"], round(value, 4)) for i in range(len(tables))],
        )

    def _mount(self, at):
        own = [key for key in ("tool.xyz_mm", "tool.rpy_deg") if key in self.session.given]
        changes = [(key.split("."), None) for key in own]
        self.session.edit(tr("Head"), [*changes, (["tool", "head"], self.head.itemText(at))])

    def _speak(self, at):
        changes = self.session.language_changes(self.language.itemText(at))
        self.session.edit(tr("Language"), [(key.split("."), to) for key, to in changes.items()])

    def _choose(self, at):
        self.session.ask("focus", contour=self.contour.currentText())
        self._draw_map()

    def _go_to(self, node):
        plans = self.session.plans.get(self.contour.currentText())
        for name in plans or ():
            when = self.session.timeline.when(name, node)
            if when is not None:
                self.session.seek(when)
                return

    def _write(self):
        try:
            self.session.export()
        except ProcessError as error:
            self.session._say(str(error))

    def _choose_folder(self):
        folder = QtWidgets.QFileDialog.getExistingDirectory(
            self.form, tr("Folder of the program"), self.session.export_folder()
        )
        if folder and self.session.job is not None:
            self.session.document.openTransaction(tr("Kerfpath: Folder"))
            self.session.job.Folder = folder
            self.session.document.commitTransaction()
            self.refresh()

    # What is shown.

    def _heard(self, kind):
        if kind == "closed":
            self._leave()
            return
        if kind == "map":
            self._draw_map()
        if kind == "exported":
            names = [name.replace("\\", "/").rsplit("/", 1)[-1] for name in self.session.exported]
            self.written.setText(
                tr("Wrote {} to {}").format(", ".join(names), self.session.export_folder())
            )
        self.refresh()

    def refresh(self):
        """Show the state of the session."""
        session, progress = self.session, self.session.progress
        ended, busy = session.studio is None, progress["busy"] and session.studio is not None
        label = progress["label"] if busy else ""
        self.status.setText(label or (tr("kerfpath does not run") if ended else tr("ready")))
        self.bar.setRange(0, progress["total"] if busy else 1)  # 0: busy, for an unknown time
        self.bar.setValue(progress["done"] if busy else 1)
        self.stop.setText(tr("Start") if ended else tr("Stop") if busy else tr("Plan"))
        text, colour = self._said()
        self.verdict.setText(text)
        self.verdict.setStyleSheet("font-weight: bold; color: {}".format(colour))
        self._fill(self.contour, list(session.plans) + list(session.none), None)
        if session.options is not None and session.values is not None:
            robots = session.options["robots"]
            ids = [each["id"] for each in robots]
            names = ["{} {}".format(each["maker"], each["model"]) for each in robots]
            model = session.value("robot.model")
            self._fill(self.robot, names, names[ids.index(model)] if model in ids else None, ids)
            self._fill(self.head, session.options["heads"], session.value("tool.head"))
            self._fill(
                self.language, session.options["languages"], session.value("program.language")
            )
            speeds = {table.get("speed_m_min") for table in session.values["contour"]} - {None}
            if speeds and not self.speed.hasFocus():
                self.speed.blockSignals(True)
                self.speed.setValue(min(speeds))
                self.speed.blockSignals(False)
                self.speed.setToolTip(
                    tr("Of all contours") if len(speeds) == 1 else tr("The lowest of the contours")
                )
        made = self._export()
        self.write.setEnabled(bool(made and made["ready"]) and not session.lost())
        self.write.setToolTip(
            (made["why"] if made and made["why"] else "") or session.export_folder()
        )
        self._show_remedies(made)
        for label in (self.status, self.verdict, self.remedies, self.legend, self.written):
            # The box around the panel would cut off their last lines.
            label.setMinimumHeight(max(label.heightForWidth(label.width()), 0))
        self.settings.refresh()
        self._moment()

    def _export(self):
        outcome = self.session.outcome
        if outcome is None or outcome["revision"] != self.session.revision:
            return None
        return next((each for each in outcome["exports"] if each["name"] == "program"), None)

    def _said(self):
        """Return the verdict, and its colour."""
        session = self.session
        if session.lost():
            return "\n".join(session.lost()), BAD
        if session.problem:
            return session.problem, BAD
        if session.faults:
            return session.faults[0], BAD
        now = session.revision
        none = [each for each in session.none.values() if each["revision"] == now]
        if none:
            return "\n".join(each["statement"] for each in none), BAD
        outcome = session.outcome
        if outcome is None or outcome["revision"] != now:
            return tr("No verdict yet"), WAIT
        if not outcome["passed"]:
            why = (self._export() or {}).get("why") or tr("see the audit")
            return tr("Not to be cut: {}").format(why), BAD
        plans = [plan for held in session.plans.values() for plan in held.values()]
        text = tr("Passed: {} audited").format(
            "{} {}".format(len(plans), tr("contour") if len(plans) == 1 else tr("contours"))
        )
        if outcome["cycle"]:
            text += ", {:.1f} s".format(outcome["cycle"]["total"])
        gaps = [plan["gap"] for plan in plans if plan["gap"] is not None]
        if gaps and len(gaps) == len(plans):
            text += tr("; at most {:.1f} % above the best motion").format(100 * max(gaps))
        return text, GOOD

    def _show_remedies(self, made):
        session = self.session
        self._offers = [
            (label, lambda c=contour, i=index: session.ask("relax", contour=c, index=i))
            for contour, index, label in session.relaxations()
        ]
        if made and made["edits"] and not self._offers:
            edits = [(each["path"], each["value"]) for each in made["edits"]]
            self._offers = [(made["remedy"], lambda: session.edit(made["remedy"], edits))]
        link = '<p><a href="{}">{}</a></p>'
        self.remedies.setText(
            "".join(link.format(i, escape(label)) for i, (label, _) in enumerate(self._offers))
        )
        self.remedies.setVisible(bool(self._offers))

    def _draw_map(self):
        name = self.contour.currentText()
        message = self.session.maps.get(name)
        if message is None or not message["layers"]:
            return
        chosen = message["course"][0]["posture"][0] if message["course"] else None
        names = [each["name"] for each in message["layers"]]
        postures = [each["posture"] for each in message["layers"]]
        if (name, postures) != self._layers:
            self._layers = (name, postures)
            now = names[postures.index(chosen)] if chosen in postures else names[0]
            self._fill(self.posture, names, now, postures)
        self.map.show_map(message, self.posture.currentData())
        square = '<span style="color:{}">■</span> {}'
        self.legend.setText(
            " ".join(
                square.format(colour, reason)
                for code, (colour, reason) in enumerate(zip(message["colours"], message["reasons"]))
                if code in self.map.codes
            )
        )

    def _moment(self):
        session, total = self.session, self.session.timeline.total
        self.play.setText(tr("Pause") if session.playing else tr("Play"))
        self.play.setEnabled(total > 0)
        self.slider.setEnabled(total > 0)
        self.time.setText("{:.1f} / {:.1f} s".format(session.t, total))
        if not self.slider.isSliderDown():
            self.slider.setValue(round(session.t / total * STEPS) if total else 0)
        moment = session.moment()
        _, contour, plan, node = moment if moment else (None, None, None, None)
        if plan is not None and session.playing and contour != self.contour.currentText():
            self.contour.setCurrentText(contour)
            self._draw_map()
        self.map.show_node(node if plan and contour == self.contour.currentText() else None)

    @staticmethod
    def _fill(box, texts, current, data=None):
        """Put texts into a box, and choose one of them."""
        if [box.itemText(i) for i in range(box.count())] != texts:
            kept = box.currentText()
            box.clear()
            for text, each in zip(texts, data or texts):
                box.addItem(text, each)
            if kept in texts:
                box.setCurrentText(kept)
        if current is not None and current != box.currentText():
            box.setCurrentText(current)


def show(session):
    """Show the panel of a session, unless it is shown."""
    global shown
    active = shown is not None and shown.session is session and Gui.Control.activeDialog()
    if not active:
        if Gui.Control.activeDialog():
            Gui.Control.closeDialog()
        shown = Panel(session)
        Gui.Control.showDialog(shown)
    return shown


shown = None
"""The panel that is shown, or was last."""
