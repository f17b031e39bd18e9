"""Write the golden files anew. Look at the difference before you commit it.

python tests/golden/regenerate.py
"""

import json
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from golden_values import frame_statistics, trajectory_figures  # noqa: E402 - the folder is on the path only now

for name, values in (("smoke_frame", frame_statistics()), ("trajectory", trajectory_figures())):
    (HERE / f"{name}.json").write_text(json.dumps(values, indent=2) + "\n")
    print(f"{name}.json")
