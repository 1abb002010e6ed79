// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Reads the text form of a COLMAP model: cameras.txt, images.txt and, where it is there, points3D.txt. Cameras and poses of
/// a few photographs are also easily written by hand in it. See https://colmap.github.io/format.html.

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <system_error>
#include <vector>

#include "../camera/brown_conrady.hpp"
#include "../config.hpp"
#include "../error.hpp"
#include "../types.hpp"
#include "text_reader.hpp"

namespace turbomap {

/// Pixels are shifted by half a one against the files, so that the centre of the upper left pixel is (0, 0), as in OpenCV;
/// there it is (0.5, 0.5).
struct colmap_camera {
  int width = 0;                ///< px
  int height = 0;               ///< px
  brown_conrady<double> model;  ///< of SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL and OPENCV
};
/// A keypoint of an image.
struct colmap_observation {
  vec2<double> pixel;  ///< shifted as said above
  std::int64_t point;  ///< id in colmap_model::points, -1: none
};
/// An image with its pose.
struct colmap_image {
  std::string name;                              ///< of the file
  int camera = 0;                                ///< id in colmap_model::cameras
  rigid_transform<double> T_cw;                  ///< world to camera
  std::vector<colmap_observation> observations;  ///< its keypoints
};
/// A model, by the ids of its files.
struct colmap_model {
  std::map<int, colmap_camera> cameras;         ///< of all images
  std::map<int, colmap_image> images;           ///< with poses
  std::map<std::int64_t, vec3<double>> points;  ///< world
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Goes to the next line that is neither blank nor a comment; the first call stays on a first line that is one.
inline bool next_colmap_line(text_reader& in, bool first) {
  for (bool there = first || in.next_line(); there; there = in.next_line())
    if (in.peek() != '\n' && in.peek() != '#') return true;
  return false;
}
inline void end_colmap_line(text_reader& in) {
  if (!in.line_ends()) in.fail("there is more on the line than belongs there");
}

inline colmap_camera read_colmap_camera(text_reader& in) {
  colmap_camera camera;
  brown_conrady<double>& m = camera.model;
  const auto name = in.take_word("model");
  camera.width = in.take_on_line<int>("width"), camera.height = in.take_on_line<int>("height");
  const bool simple = name.rfind("SIMPLE_", 0) == 0;
  if (name != "SIMPLE_PINHOLE" && name != "PINHOLE" && name != "SIMPLE_RADIAL" && name != "RADIAL" && name != "OPENCV")
    in.fail("camera model " + name + " is not SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL or OPENCV");
  const auto next = [&](const char* what) { return in.take_on_line<double>(what); };
  m.fx = next("focal length");
  m.fy = simple || name == "RADIAL" ? m.fx : next("second focal length");
  m.cx = next("cx") - 0.5, m.cy = next("cy") - 0.5;
  if (name != "SIMPLE_PINHOLE" && name != "PINHOLE") m.k1 = next("k1");
  if (name == "RADIAL" || name == "OPENCV") m.k2 = next("k2");
  if (name == "OPENCV") m.p1 = next("p1"), m.p2 = next("p2");
  end_colmap_line(in);
  if (camera.width <= 0 || camera.height <= 0) in.fail("the image has no size");
  if (!(m.fx > 0) || !(m.fy > 0)) in.fail("a focal length is not positive");
  return camera;
}

inline colmap_image read_colmap_image(text_reader& in) {
  colmap_image image;
  auto& T = image.T_cw;
  const auto next = [&](const char* what) { return in.take_on_line<double>(what); };
  T.qw = next("qw"), T.qx = next("qx"), T.qy = next("qy"), T.qz = next("qz");
  T.tx = next("tx"), T.ty = next("ty"), T.tz = next("tz");
  const double norm = std::sqrt(T.qx * T.qx + T.qy * T.qy + T.qz * T.qz + T.qw * T.qw);
  if (!(std::abs(norm - 1) < 1e-2)) in.fail("the rotation is no unit quaternion");
  T.qx /= norm, T.qy /= norm, T.qz /= norm, T.qw /= norm;  // it has few digits
  image.camera = in.take_on_line<int>("camera id");
  image.name = in.take_rest("file name");  // which may have blanks
  bool there = in.next_line();
  while (there && in.peek() == '#') there = in.next_line();
  while (there && !in.line_ends()) {  // its keypoints; the line may be empty, or missing at the end of the file
    const auto x = next("x"), y = next("y");
    image.observations.push_back({{x - 0.5, y - 0.5}, in.take_on_line<std::int64_t>("point id")});
  }
  return image;
}

template <class Id, class Value>
void add_colmap_entry(text_reader& in, std::map<Id, Value>& entries, const char* what, Id id, const Value& value) {
  if (!entries.emplace(id, value).second) in.fail(std::string(what) + " " + std::to_string(id) + " is there already");
}

}  // namespace detail

/// Reads a model. Throws bad_file naming file, line and reason, also for ids that come twice, numbers that do not belong
/// there, and an image of a camera, or an observation of a point, that is not there (the latter only with points3D.txt).
/// Camera models of fisheye lenses are refused.
inline colmap_model read_colmap_model(const std::filesystem::path& folder) {
  using detail::next_colmap_line;
  colmap_model model;
  detail::text_reader cameras(folder / "cameras.txt");
  for (bool first = true; next_colmap_line(cameras, first); first = false) {
    const int id = cameras.take_on_line<int>("camera id");
    detail::add_colmap_entry(cameras, model.cameras, "camera", id, detail::read_colmap_camera(cameras));
  }
  std::error_code ignored;
  const bool with_points = std::filesystem::exists(folder / "points3D.txt", ignored);
  if (with_points) {
    detail::text_reader points(folder / "points3D.txt");
    for (bool first = true; next_colmap_line(points, first); first = false) {
      const auto id = points.take_on_line<std::int64_t>("point id");
      const auto next = [&](const char* what) { return points.take_on_line<double>(what); };
      const double x = next("x"), y = next("y"), z = next("z");
      detail::add_colmap_entry(points, model.points, "point", id, {x, y, z});
    }
  }
  detail::text_reader images(folder / "images.txt");
  for (bool first = true; next_colmap_line(images, first); first = false) {
    const int id = images.take_on_line<int>("image id");
    const colmap_image image = detail::read_colmap_image(images);
    if (model.cameras.count(image.camera) == 0) images.fail("there is no camera " + std::to_string(image.camera));
    for (const colmap_observation& o : image.observations)
      if (o.point < -1 || (with_points && o.point != -1 && model.points.count(o.point) == 0))
        images.fail("there is no point " + std::to_string(o.point));
    detail::add_colmap_entry(images, model.images, "image", id, image);
  }
  if (model.images.empty()) images.fail("there is no image");
  return model;
}

TURBOMAP_END_NAMESPACE
