"""What is run: the only place that sees both the method and the simulator."""

import sim

if getattr(sim, "DISTRIBUTION", None) != "dotmask":
    raise ImportError(
        f"another package named 'sim' hides ours: {sim.__file__}. Uninstall it or use a clean virtual environment."
    )
