"""`dotmask validate` writes a page with tables and plots."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from scenarios.cli import app


@pytest.mark.acceptance
def test_a_quick_page_has_a_table_and_plots_and_says_that_it_is_quick(tmp_path: Path) -> None:
    out = tmp_path / "docs" / "validation"
    done = CliRunner().invoke(
        app, ["validate", "--quick", "--out", str(out), "--only", "consistency", "--only", "tracking"]
    )
    assert done.exit_code == 0, done.output
    text = (tmp_path / "docs" / "validation.md").read_text()
    assert "Made with `--quick`" in text
    assert "| plate, bbox_centre |" in text
    assert "| `crossing` | calibrated |" in text
    for name in ("consistency", "consistency_other"):
        assert f"(validation/{name}.png)" in text
        assert (out / f"{name}.png").stat().st_size > 10_000
