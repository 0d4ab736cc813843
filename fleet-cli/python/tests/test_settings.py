"""Where a connection's settings come from."""

from __future__ import annotations

import os
import tempfile
import unittest
from pathlib import Path
from unittest import mock

from xtb_fleet import Invalid, NotAllowed
from xtb_fleet.settings import Settings, resolve

IDENTITY = """version = 1
fleet = "hall"
name = "alice"
role = "{role}"
generation = 1
routers = ["tls/10.0.0.1:7447"]
"""


class Where(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.home = Path(folder.name)
        (self.home / "xtb").mkdir()
        environment = mock.patch.dict(os.environ, {"XDG_CONFIG_HOME": folder.name}, clear=True)
        environment.start()
        self.addCleanup(environment.stop)

    def enrol(self, role: str = "operator") -> Path:
        folder = self.home / "xtb" / "identity"
        folder.mkdir()
        (folder / "identity.toml").write_text(IDENTITY.format(role=role), "utf-8")
        for name in ("ca.pem", "certificate.pem", "key.pem"):
            (folder / name).write_text("-----BEGIN", "utf-8")
        return folder

    def found(self, **more: str) -> Settings:
        return resolve(more.get("endpoint"), more.get("fleet"), more.get("name"), more.get("identity"), 1.0)

    def test_without_anything(self) -> None:
        found = self.found()
        self.assertEqual((found.endpoints, found.fleet, found.identity), (("tcp/127.0.0.1:7447",), "lab", None))
        self.assertRegex(found.client, "^python-[0-9a-f]{6}$")

    def test_arguments_over_environment_over_file(self) -> None:
        text = 'fleet = "file"\nconnect = ["tcp/1:1"]\n[[robots]]\nname = "xtb-7"\n'
        (self.home / "xtb" / "fleet.toml").write_text(text, "utf-8")
        found = self.found()
        self.assertEqual((found.endpoints, found.fleet, found.roster), (("tcp/1:1",), "file", ("xtb-7",)))
        os.environ |= {"XTB_CONNECT": "tcp/2:2,tcp/3:3", "XTB_FLEET": "env"}
        found = self.found()
        self.assertEqual((found.endpoints, found.fleet), (("tcp/2:2", "tcp/3:3"), "env"))
        found = self.found(endpoint="tcp/4:4", fleet="arg", name="me")
        self.assertEqual((found.endpoints, found.fleet, found.client), (("tcp/4:4",), "arg", "me"))

    def test_an_identity_says_where_and_who(self) -> None:
        folder = self.enrol()
        found = self.found()
        self.assertEqual((found.endpoints, found.fleet), (("tls/10.0.0.1:7447",), "hall"))
        self.assertRegex(found.client, "^alice-[0-9a-f]{6}$")
        self.assertEqual(self.found(name="alice-desk").client, "alice-desk")
        for wrong in ({"name": "bob"}, {"fleet": "lab"}, {"endpoint": "tcp/10.0.0.1:7447"}):
            with self.assertRaises(Invalid, msg=str(wrong)):
                self.found(**wrong)
        for without in ({"identity": "none"}, {}):
            os.environ["XTB_IDENTITY"] = ""
            self.assertIsNone(self.found(**without).identity)
        os.environ["XTB_IDENTITY"] = str(folder)
        self.assertIsNotNone(self.found().identity)
        (folder / "key.pem").unlink()
        with self.assertRaises(Invalid) as broken:
            self.found()
        self.assertEqual(broken.exception.code, "config")

    def test_what_cannot_be_is_refused(self) -> None:
        for wrong in ({"fleet": "Lab"}, {"name": "a/b"}, {"endpoint": "tls/1:1"}, {"identity": "/nowhere"}):
            with self.assertRaises(Invalid, msg=str(wrong)):
                self.found(**wrong)
        config = self.home / "xtb" / "fleet.toml"
        for text in ("fleet = 3", "fleet", "connect = 'tcp/1:1'", "[[robots]]\ntag = 1", "[[robots]]\nname = 'all'"):
            config.write_text(text, "utf-8")
            with self.assertRaises(Invalid, msg=text):
                self.found()

    def test_a_viewer_may_stop_and_not_drive(self) -> None:
        self.enrol("viewer")
        found = self.found()
        found.may("look")
        found.may("call an emergency stop")
        with self.assertRaises(NotAllowed) as refused:
            found.may("control robots")
        self.assertEqual(refused.exception.code, "not_allowed")


if __name__ == "__main__":
    unittest.main()
