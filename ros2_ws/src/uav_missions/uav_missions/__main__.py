"""``python -m uav_missions``: fly a mission."""

import sys

from uav_missions.runner import main

sys.exit(main())
