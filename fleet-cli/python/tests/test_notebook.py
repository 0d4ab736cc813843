"""The notebook of examples/, executed from top to bottom: by nbclient where it is installed, else cell by cell here."""

from __future__ import annotations

import json
import os
import unittest
from pathlib import Path
from typing import Any
from unittest import mock

from rig import Sim

NOTEBOOK = Path(__file__).parent.parent / "examples" / "first_drive.ipynb"


class Notebook(unittest.TestCase):
    def setUp(self) -> None:
        self.sim = Sim()
        self.addCleanup(self.sim.end)
        environment = mock.patch.dict(os.environ, {"XTB_CONNECT": self.sim.endpoint, "XTB_IDENTITY": ""})
        environment.start()
        self.addCleanup(environment.stop)

    def test_every_cell_runs(self) -> None:
        text = NOTEBOOK.read_text("utf-8")
        try:
            import ipykernel  # noqa: F401
            import nbclient
            import nbformat
        except ImportError:
            names: dict[str, Any] = {}
            for cell in json.loads(text)["cells"]:
                if cell["cell_type"] == "code":
                    exec(compile("".join(cell["source"]), str(NOTEBOOK), "exec"), names)
            return
        for tries_left in (2, 1, 0):
            notebook = nbformat.reads(text, as_version=4)  # type: ignore[no-untyped-call]
            try:
                nbclient.NotebookClient(notebook, timeout=180).execute()
                break
            except nbclient.exceptions.CellExecutionError as error:
                # A computer that is too busy for the kernel to keep the lease is no fault of the notebook.
                if "timed out" not in str(error) or not tries_left:
                    raise
        shown = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
        tables = [output for output in shown if "text/html" in output.get("data", {})]
        self.assertGreaterEqual(len(tables), 5, "fleet, states, tasks and report are shown as tables")


if __name__ == "__main__":
    unittest.main()
