"""The language server, driven as an editor drives it: JSON-RPC over the standard streams of a process."""

from __future__ import annotations

import json
import queue
import subprocess
import sys
import threading

import pytest

from alula_testing.waits import HANGS_S

URI = "file:///tmp/does_not_exist/robot.rl"
TEXT = """type Point

skillset robot {
  data battery: Point period 1 sec
  resource axes {
    state { FREE USED }
    initial FREE
    transition { FREE -> USED  USED -> FREE }
  }
  skill goto {
    input target: Point
    effect take: axes -> USED
    precondition free: axes == FREE
    start take
    success ok { effect axes -> FREE }
    failure ko
  }
}
"""


class Editor:
    """The other end of the protocol."""

    def __init__(self):
        command = [sys.executable, "-m", "alula.cli.editor"]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        self.received = queue.Queue()
        self.number = 0
        threading.Thread(target=self._receive, daemon=True).start()

    def _receive(self):
        out = self.process.stdout
        while header := out.readline():
            length = int(header.split(b":")[1]) if header.lower().startswith(b"content-length") else 0
            while out.readline().strip():
                pass
            self.received.put(json.loads(out.read(length)))

    def send(self, method, params, **more):
        body = json.dumps({"jsonrpc": "2.0", "method": method, "params": params, **more}).encode()
        self.process.stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
        self.process.stdin.flush()

    def ask(self, method, params):
        return self.answer(method, params)["result"]

    def answer(self, method, params):
        self.number += 1
        self.send(method, params, id=self.number)
        return self.wait(lambda m: m.get("id") == self.number and "method" not in m)

    def refused(self, method, line, text, **more):
        column = TEXT.split("\n")[line].index(text)
        where = {"textDocument": {"uri": URI}, "position": {"line": line, "character": column}}
        return self.answer(method, {**where, **more})["error"]["message"]

    def told(self):
        return self.wait(lambda m: m.get("method") == "textDocument/publishDiagnostics")["params"]

    def wait(self, wanted):
        while True:
            message = self.received.get(timeout=HANGS_S)
            if wanted(message):
                return message

    def at(self, method, line, text, offset=0, **more):
        """Ask about the place of a text in a line of TEXT, counted as editors do."""
        column = TEXT.split("\n")[line].index(text) + offset
        return self.ask(method, {"textDocument": {"uri": URI}, "position": {"line": line, "character": column}, **more})

    def change(self, text, version):
        document = {"uri": URI, "version": version}
        self.send("textDocument/didChange", {"textDocument": document, "contentChanges": [{"text": text}]})
        return self.told()["diagnostics"]


@pytest.fixture
def editor():
    editor = Editor()
    try:
        capabilities = editor.ask("initialize", {"processId": None, "rootUri": None, "capabilities": {}})["capabilities"]
        assert capabilities["hoverProvider"]
        assert capabilities["definitionProvider"]
        assert "completionProvider" in capabilities
        editor.send("initialized", {})
        yield editor
        editor.ask("shutdown", None)
        editor.send("exit", None)
        assert editor.process.wait(HANGS_S) == 0
    finally:
        editor.process.kill()
        editor.process.wait(HANGS_S)


def place(line, start, end):
    return {"start": {"line": line, "character": start}, "end": {"line": line, "character": end}}


def test_an_editing_session(editor):
    document = {"uri": URI, "languageId": "alula", "version": 1, "text": TEXT}
    editor.send("textDocument/didOpen", {"textDocument": document})
    assert editor.told() == {"uri": URI, "diagnostics": []}

    # Completion: states behind a resource, names and words elsewhere, types behind a colon.
    labels = {c["label"] for c in editor.at("textDocument/completion", 12, "FREE", 2)["items"]}
    assert labels == {"FREE", "USED"}
    labels = {c["label"]: c.get("detail") for c in editor.at("textDocument/completion", 13, "start")["items"]}
    assert {"axes", "battery", "goto", "take", "precondition", "guard"} <= set(labels)
    assert labels["axes"] == "FREE USED"
    assert labels["take"] == "effect of goto"
    assert "Point" in {c["label"] for c in editor.at("textDocument/completion", 10, "Point")["items"]}

    # Hover: the resource with its transitions, the skill's signature, an effect.
    told = editor.at("textDocument/hover", 12, "axes", 1)
    assert "state { FREE USED }" in told["contents"]["value"]
    assert "FREE -> USED" in told["contents"]["value"]
    assert told["range"] == place(12, 23, 27)
    assert "skill goto(target: Point)" in editor.at("textDocument/hover", 9, "goto")["contents"]["value"]
    assert "axes -> USED" in editor.at("textDocument/hover", 13, "take")["contents"]["value"]
    assert editor.at("textDocument/hover", 13, "start") is None

    # Definition: a resource, a state, an effect, a type.
    definition = "textDocument/definition"
    assert editor.at(definition, 12, "axes")["range"] == place(4, 11, 15)
    assert editor.at(definition, 12, "FREE")["range"] == place(5, 12, 16)
    assert editor.at(definition, 13, "take")["range"] == place(11, 11, 15)
    assert editor.at(definition, 10, "Point")["range"] == place(0, 5, 10)
    assert editor.at(definition, 13, "start") is None

    # Changes: every error with its place in UTF-16 units, also behind a character that has two of them.
    wrong = TEXT.replace("axes == FREE", "/* \U0001f681 */ axes == FRE").replace("target: Point", "target Point")
    first, *_ = editor.change(wrong, 2)
    assert (first["code"], first["severity"], first["range"]) == ("ALU103", 1, place(10, 17, 22))
    (finding,) = editor.change(wrong.replace("target Point", "target: Point"), 3)
    assert finding["code"] == "ALU203"
    assert finding["range"] == place(12, 40, 43)
    assert "did you mean `FREE`?" in finding["message"]
    assert editor.change(TEXT, 4) == []

    # A file that goes away leaves nothing behind; any junk is answered.
    assert editor.change("\x00" * 1000, 5)[0]["code"] == "ALU100"
    assert editor.change("a" * 400_000, 6)[0]["code"] == "ALU003"
    editor.send("textDocument/didClose", {"textDocument": {"uri": URI}})
    assert editor.told() == {"uri": URI, "diagnostics": []}

    # A document that is not open has nothing to tell.
    nowhere = {"textDocument": {"uri": "file:///tmp/never_opened.rl"}}
    where = {**nowhere, "position": {"line": 3, "character": 5}}
    assert editor.ask("textDocument/completion", where)["items"] == []
    assert editor.ask("textDocument/hover", where) is None
    assert editor.ask("textDocument/definition", where) is None
    assert not editor.ask("textDocument/documentSymbol", nowhere)
    assert not editor.ask("textDocument/references", {**where, "context": {"includeDeclaration": True}})
    assert editor.ask("textDocument/rename", {**where, "newName": "x"}) is None


def test_names_and_outline(editor):
    document = {"uri": URI, "languageId": "alula", "version": 1, "text": TEXT}
    editor.send("textDocument/didOpen", {"textDocument": document})
    assert editor.told() == {"uri": URI, "diagnostics": []}

    # References and a new name: of the resource, and of a state where another resource has one of that name.
    found = editor.at("textDocument/references", 12, "axes", context={"includeDeclaration": True})
    assert [(one["range"]["start"]["line"], one["range"]["start"]["character"]) for one in found] == [(4, 11), (11, 17), (12, 23), (14, 24)]
    used = editor.at("textDocument/references", 12, "axes", context={"includeDeclaration": False})
    assert used == found[1:], "without the place where it is declared"
    edit = editor.at("textDocument/rename", 12, "FREE", newName="IDLE")
    places = [(one["range"]["start"]["line"], one["newText"]) for one in edit["changes"][URI]]
    assert places == [(5, "IDLE"), (6, "IDLE"), (7, "IDLE"), (7, "IDLE"), (12, "IDLE"), (14, "IDLE")]
    assert "is there already" in editor.refused("textDocument/rename", 12, "FREE", newName="USED")
    assert "is no name" in editor.refused("textDocument/rename", 12, "FREE", newName="a b")

    # The outline.
    (outline,) = editor.ask("textDocument/documentSymbol", {"textDocument": {"uri": URI}})
    assert [(one["name"], [child["name"] for child in one.get("children", [])]) for one in outline["children"]] == [
        ("battery", []),
        ("axes", []),
        ("goto", ["target", "ok", "ko"]),
    ]


def test_what_the_files_of_a_robot_share_is_renamed_in_all_of_them(editor, tmp_path):
    texts = {
        "arm.rl": "type Point\nskillset arm {\n  use camera\n  data at: Point\n  data seen: Picture\n}\n",
        "camera.rl": "skillset camera {\n  type Picture\n  type Point\n  data look: Picture\n  data from: Point\n}\n",
        "types.yaml": "Point: geometry_msgs/Point\nPicture: sensor_msgs/Image\n",
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    uris = {name: (tmp_path / name).as_uri() for name in texts}
    editor.send(
        "textDocument/didOpen", {"textDocument": {"uri": uris["arm.rl"], "languageId": "alula", "version": 1, "text": texts["arm.rl"]}}
    )
    editor.told()

    def rename(line, character, name):
        where = {"textDocument": {"uri": uris["arm.rl"]}, "position": {"line": line, "character": character}}
        return editor.answer("textDocument/rename", {**where, "newName": name})

    def places(answer):
        changes = answer["result"]["changes"]
        return {
            name: [(e["range"]["start"]["line"], e["range"]["start"]["character"]) for e in changes.get(uris[name], [])] for name in texts
        }

    assert places(rename(3, 11, "Place")) == {"arm.rl": [(0, 5), (3, 11)], "camera.rl": [(2, 7), (4, 13)], "types.yaml": [(0, 0)]}
    assert places(rename(4, 13, "Image")) == {"arm.rl": [(4, 13)], "camera.rl": [(1, 7), (3, 13)], "types.yaml": [(1, 0)]}
    assert places(rename(2, 7, "eye")) == {"arm.rl": [(2, 6)], "camera.rl": [(0, 9)], "types.yaml": []}
    assert "`Picture` is there already" in rename(3, 11, "Picture")["error"]["message"]
    (tmp_path / "camera.rl").write_text("skillset camera { data")
    assert "camera.rl has errors of syntax" in rename(3, 11, "Place")["error"]["message"]


def test_changes_and_proofs(editor):
    document = {"uri": URI, "languageId": "alula", "version": 1, "text": TEXT}
    editor.send("textDocument/didOpen", {"textDocument": document})
    assert editor.told() == {"uri": URI, "diagnostics": []}

    # A part of the text that changes; a hint as a change.
    change = {"range": place(12, 31, 35), "text": "FREI"}
    editor.send("textDocument/didChange", {"textDocument": {"uri": URI, "version": 5}, "contentChanges": [change]})
    (finding,) = editor.told()["diagnostics"]
    assert finding["code"] == "ALU203"
    document = {"textDocument": {"uri": URI}}
    (action,) = editor.ask("textDocument/codeAction", {**document, "range": finding["range"], "context": {"diagnostics": []}})
    assert action["title"] == "Change `FREI` to `FREE`"
    assert action["edit"]["changes"][URI] == [{"range": place(12, 31, 35), "newText": "FREE"}]
    assert editor.change(TEXT, 6) == []

    # Indentation.
    assert editor.ask("textDocument/formatting", {**document, "options": {"tabSize": 2, "insertSpaces": True}}) in ([], None)
    editor.change(TEXT.replace("    input", "input"), 7)
    (edit,) = editor.ask("textDocument/formatting", {**document, "options": {"tabSize": 2, "insertSpaces": True}})
    assert edit["newText"] == TEXT

    # What is proved is told when the file is saved.
    faulty = TEXT.replace("start take", "start take\n    invariant mine: axes == FREE")
    editor.change(faulty, 8)
    editor.send("textDocument/didSave", document)
    told = {finding["code"]: finding["message"] for finding in editor.told()["diagnostics"]}
    assert "1. initially axes == FREE\n2. goto starts: axes FREE -> USED; `mine` of goto is false and ends it" in told["ALU510"]


def test_completion_in_a_file_that_is_broken_at_the_cursor(editor):
    text = TEXT.replace("axes == FREE", "axes == ")
    document = {"uri": URI, "languageId": "alula", "version": 1, "text": text}
    editor.send("textDocument/didOpen", {"textDocument": document})
    assert editor.told()["diagnostics"] != []
    where = {"line": 12, "character": text.split("\n")[12].index("axes == ") + 8}
    items = editor.ask("textDocument/completion", {"textDocument": {"uri": URI}, "position": where})["items"]
    assert [c["label"] for c in items] == ["FREE", "USED"]
