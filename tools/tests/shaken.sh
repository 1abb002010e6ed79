# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# Read by imu.sh and damaged_imu.sh.
# shaken: prints 20 s of sines, from 1000 s on, in the format of TUM: t x y z qx qy qz qw.
shaken() {
  awk 'BEGIN {
    for (i = 0; i <= 400; ++i) {
      t = 0.05 * i; w = 6.283185307
      x = 0.5 * sin(w * t / 12) + 0.25 * sin(w * t / 2.3)
      y = 0.4 * sin(w * t / 9 + 1) + 0.2 * sin(w * t / 1.9)
      z = 0.15 * sin(w * t / 2.7 + 2)
      a = 0.3 * sin(w * t / 7) / 2; b = 0.15 * sin(w * t / 3.3 + 1) / 2; c = 0.15 * sin(w * t / 2.9) / 2
      printf "%.2f %.6f %.6f %.6f %.8f %.8f %.8f %.8f\n", 1000 + t, x, y, z, \
        cos(a) * cos(b) * sin(c) - sin(a) * sin(b) * cos(c), cos(a) * sin(b) * cos(c) + sin(a) * cos(b) * sin(c), \
        sin(a) * cos(b) * cos(c) - cos(a) * sin(b) * sin(c), cos(a) * cos(b) * cos(c) + sin(a) * sin(b) * sin(c)
    }
  }'
}
