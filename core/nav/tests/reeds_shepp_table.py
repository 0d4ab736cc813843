"""Writes reeds_shepp_table.csv: lengths by the Open Motion Planning Library (PyPI: ompl 2.0.1).

pip install ompl && python reeds_shepp_table.py > reeds_shepp_table.csv
"""

import math
import random

from ompl import base

random.seed(2004_262)
print("radius_m,x0_m,y0_m,yaw0_rad,x1_m,y1_m,yaw1_rad,length_m")
for number in range(2000):
    radius = random.choice([0.393, 1.0, 3.0])
    space = base.ReedsSheppStateSpace(radius)
    reach = radius * random.choice([0.5, 2.0, 10.0])  # close, and too far for most words
    pair = []
    for _ in range(2):
        state = space.allocState()
        state.setX(round(random.uniform(-reach, reach), 6))
        state.setY(round(random.uniform(-reach, reach), 6))
        state.setYaw(round(random.uniform(-math.pi, math.pi), 6))
        pair.append(state)
    values = [v for s in pair for v in (s.getX(), s.getY(), s.getYaw())]
    print(",".join(f"{v:.9g}" for v in [radius, *values, space.distance(*pair)]))
