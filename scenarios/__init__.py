"""What is run: the only place that sees both the method and the simulator.

PYTEST_DONT_REWRITE: pytest would warn of every program that imports this before it starts pytest.
"""

import sim

DISTRIBUTION = "dotmask"
"""Which distribution this package is of: its name is a common word."""

if getattr(sim, "DISTRIBUTION", None) != "dotmask":
    raise ImportError(
        f"another package named 'sim' hides ours: {sim.__file__}. Uninstall it or use a clean virtual environment."
    )
