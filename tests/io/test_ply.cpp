// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

#include <turbomap/io/ply.hpp>

#include <filesystem>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "support/files.hpp"

using turbomap::vec3;

TEST_CASE("cameras come first, joined by edges; points that are not finite are left out") {
  const turbomap_test::temporary_directory folder;
  const turbomap_test::comma_locale comma;
  const std::vector<vec3<double>> cameras{{0, 0, 0}, {1, 0.5, -2}, {2, 0, 0}};
  const std::vector<vec3<double>> points{{1e6, 0, 0.25}, {std::numeric_limits<double>::quiet_NaN(), 0, 0}};
  turbomap::write_ply(folder / "m.ply", points, cameras);
  CHECK(turbomap_test::file_bytes(folder / "m.ply") ==
        "ply\nformat ascii 1.0\ncomment metres, world frame; cameras first\nelement vertex 4\n"
        "property double x\nproperty double y\nproperty double z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\n"
        "element edge 2\nproperty int vertex1\nproperty int vertex2\nend_header\n"
        "0.000000000 0.000000000 0.000000000 220 40 40\n"
        "1.000000000 0.500000000 -2.000000000 220 40 40\n"
        "2.000000000 0.000000000 0.000000000 220 40 40\n"
        "1000000.000000000 0.000000000 0.250000000 130 130 130\n"
        "0 1\n1 2\n");
}

TEST_CASE("an empty map is a file without vertices") {
  const turbomap_test::temporary_directory folder;
  turbomap::write_ply(folder / "m.ply", {});
  const std::string text = turbomap_test::file_bytes(folder / "m.ply");
  CHECK(turbomap_test::has(text, "element vertex 0\n"));
  CHECK(turbomap_test::has(text, "element edge 0\n"));
}

TEST_CASE("what cannot be written is refused, and the file stays") {
  const turbomap_test::temporary_directory folder;
  turbomap::write_ply(folder / "m.ply", {});
  const std::string before = turbomap_test::file_bytes(folder / "m.ply");
  const std::vector<vec3<double>> nowhere{{0, 0, 0}, {std::numeric_limits<double>::infinity(), 0, 0}};
  CHECK_THROWS_AS(turbomap::write_ply(folder / "m.ply", {}, nowhere), std::invalid_argument);
  const std::vector<vec3<double>> above{{0, 0, std::numeric_limits<double>::infinity()}};
  CHECK_THROWS_WITH_AS(turbomap::write_ply(folder / "m.ply", {}, above), "turbomap: cameras[0] = inf: must be finite",
                       std::invalid_argument);
  CHECK(turbomap_test::file_bytes(folder / "m.ply") == before);
  CHECK_THROWS_AS(turbomap::write_ply(folder / "none" / "m.ply", {}), turbomap::bad_file);
}
