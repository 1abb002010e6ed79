// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// COLMAP text models: what is read, and what is refused.

#include <doctest/doctest.h>

#include <string>
#include <turbomap/io/colmap_model.hpp>

#include "support/files.hpp"

using namespace turbomap_test;

namespace {

struct model_files {
  std::string cameras =
      "# a comment\n1 SIMPLE_RADIAL 640 480 500 320 240 -0.1\n2 OPENCV 640 480 500 510 320 240 1 2 3 4\n";
  std::string images =
      "# a comment\n"
      "7 1 0 0 0 1 2 3 1 one.jpg\n10.5 20.5 4 30 40 -1\n"
      "9 0 1 0 0 0 0 0 2 two.jpg\n\n";
  std::string points = "4 1.5 -2 3 255 255 255 0.1 7 0\n";
};

turbomap::colmap_model read(const model_files& files) {
  const temporary_directory folder;
  write_bytes(folder / "cameras.txt", files.cameras);
  write_bytes(folder / "images.txt", files.images);
  if (!files.points.empty()) write_bytes(folder / "points3D.txt", files.points);
  return turbomap::read_colmap_model(folder.path());
}
std::string message(const model_files& files) {
  return bad_file_message([&] { read(files); });
}

}  // namespace

TEST_CASE("cameras, images and points are read, pixels shifted to centres") {
  const auto model = read({});
  REQUIRE(model.cameras.size() == 2);
  const auto& simple = model.cameras.at(1).model;
  CHECK(model.cameras.at(1).width == 640);
  CHECK(model.cameras.at(1).height == 480);
  CHECK(simple.fx == 500);
  CHECK(simple.fy == 500);
  CHECK(simple.cx == 319.5);
  CHECK(simple.cy == 239.5);
  CHECK(simple.k1 == -0.1);
  const auto& full = model.cameras.at(2).model;
  CHECK(full.fy == 510);
  CHECK(full.k1 == 1);
  CHECK(full.k2 == 2);
  CHECK(full.p1 == 3);
  CHECK(full.p2 == 4);
  REQUIRE(model.images.size() == 2);
  const auto& one = model.images.at(7);
  CHECK(one.name == "one.jpg");
  CHECK(one.camera == 1);
  CHECK(one.T_cw.qw == 1);
  CHECK(one.T_cw.tz == 3);
  REQUIRE(one.observations.size() == 2);
  CHECK(one.observations[0].pixel.x == 10);
  CHECK(one.observations[0].pixel.y == 20);
  CHECK(one.observations[0].point == 4);
  CHECK(one.observations[1].point == -1);
  CHECK(model.images.at(9).T_cw.qx == 1);
  CHECK(model.images.at(9).observations.empty());
  CHECK(model.points.at(4).y == -2);
}

TEST_CASE("a model written by hand: no points, no line after the last image, other cameras") {
  model_files files;
  files.points = "";
  files.images = "1 1 0 0 0 0 0 0 1 a.jpg\r\n\r\n2 1 0 0 0 0 0 0 1 b.jpg";
  files.cameras =
      "1 PINHOLE 640 480 500 510 320 240\n2 SIMPLE_PINHOLE 64 48 50 32 24\n3 RADIAL 64 48 50 32 24 0.5 0.25\n";
  const auto model = read(files);
  CHECK(model.images.at(2).name == "b.jpg");
  CHECK(model.cameras.at(1).model.fy == 510);
  CHECK(model.cameras.at(2).model.fy == 50);
  CHECK(model.cameras.at(3).model.k1 == 0.5);
  CHECK(model.cameras.at(3).model.k2 == 0.25);
  CHECK(model.points.empty());
}

TEST_CASE("what is broken is named with its line") {
  const auto with_cameras = [](const std::string& text) {
    return message({text, model_files().images, model_files().points});
  };
  const auto with_images = [](const std::string& text) {
    return message({model_files().cameras, text, model_files().points});
  };
  CHECK(has(with_cameras("\n1 THIN_PRISM 640 480 1\n"), "cameras.txt: line 2: camera model THIN_PRISM"));
  CHECK(has(with_cameras("1 PINHOLE 640 480 500 510 320\n"), "line 1: there is no cy"));
  CHECK(has(with_cameras("1 PINHOLE 640 480 0 510 320 240\n"), "focal length is not positive"));
  CHECK(has(with_images("1 1 0 0 0 0 0 0 5 a.jpg\n"), "there is no camera 5"));
  CHECK(has(with_images("1 2 0 0 0 0 0 0 1 a.jpg\n"), "no unit quaternion"));
  CHECK(has(with_images("1 1 0 0 0 0 0 zero 1 a.jpg\n"), "'zero' is no tz"));
  CHECK(has(with_images("1 1 0 0 0 0 0 0 1\n"), "there is no file name"));
  CHECK(has(with_images("1 1 0 0 0 0 0 0 1 a.jpg\n1 2 77\n"), "images.txt: line 2: there is no point 77"));
  CHECK(has(with_images("1 1 0 0 0 0 0 0 1 a.jpg\n1 2\n"), "there is no point id"));
  CHECK(has(with_images("# nothing\n"), "there is no image"));
  CHECK(has(with_cameras("1 PINHOLE 640.7 480 500 510 320 240\n"), "'640.7' is no width"));
  CHECK(has(with_cameras("1 PINHOLE 640 480 500 510 320 240 -0.3 0.1\n"), "more on the line"));
  CHECK(has(with_cameras("1 SIMPLE_PINHOLE 640 480 500 510 320 240\n"), "more on the line"));
  CHECK(has(with_cameras("1 PINHOLE 640 480 1e999 510 320 240\n"), "'1e999' is no focal length"));
  CHECK(has(with_cameras("1 PINHOLE 640 480 0x10 510 320 240\n"), "'0x10' is no focal length"));
  CHECK(has(with_cameras("1 PINHOLE 64 48 50 51 32 24\n1 PINHOLE 64 48 50 51 32 24\n"), "line 2: camera 1 is there"));
  CHECK(has(with_images("1 1 0 0 0 0 0 0 1 a.jpg\n\n1 1 0 0 0 0 0 0 1 b.jpg\n\n"), "image 1 is there already"));
  CHECK(has(with_images("1 1 0 0 0 0 0 0 1 a.jpg\n1 2 5.5 300 -1\n"), "line 2: '5.5' is no point id"));
  CHECK(has(with_images("1 1 0 0 0 0 0 0 1 a.jpg\n1 2 -2\n"), "there is no point -2"));
  CHECK(has(message({model_files().cameras, model_files().images, "4 1 2 3\n4 5 6 7\n"}), "line 2: point 4 is there"));
  const temporary_directory empty;
  std::filesystem::create_directory(empty / "cameras.txt");
  CHECK(has(bad_file_message([&] { turbomap::read_colmap_model(empty.path()); }), "cameras.txt: cannot be opened"));
  std::filesystem::remove(empty / "cameras.txt");
  CHECK(has(bad_file_message([&] { turbomap::read_colmap_model(empty.path()); }), "cameras.txt: cannot be opened"));
}

TEST_CASE("a name may have blanks; a comment may stand before the keypoints") {
  model_files files;
  files.images = "7 1 0 0 0 1 2 3 1  my photo.jpg \r\n# its keypoints\n10.5 20.5 4\n";
  const auto image = read(files).images.at(7);
  CHECK(image.name == "my photo.jpg");
  CHECK(image.observations.size() == 1);
}

TEST_CASE("numbers mean the same in every locale") {
  const comma_locale comma;
  const auto model = read({"1 PINHOLE 640 480 435.204 435.204 320.125 240.125\n",
                           "1 1 0 0 0 1.250 2.500 3.125 1 a\n100.500 200.250 4\n", "4 1.500 2 3\n"});
  CHECK(model.cameras.at(1).model.fx == 435.204);
  CHECK(model.cameras.at(1).model.cx == 319.625);
  CHECK(model.images.at(1).T_cw.tx == 1.25);
  CHECK(model.images.at(1).observations.at(0).pixel.x == 100);
  CHECK(model.points.at(4).x == 1.5);
}
