"""``./alula bench perception``."""

import sys

from perception_bench.run import main

sys.exit(main())
