"""python -m proxcgal_ros."""

import sys

from proxcgal_ros.cli import main

sys.exit(main())
