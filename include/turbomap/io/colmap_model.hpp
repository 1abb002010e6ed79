// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Reads the text form of a COLMAP model: cameras.txt, images.txt and, where it is there, points3D.txt. Cameras and poses of
/// a few photographs are also easily written by hand in it. See https://colmap.github.io/format.html.

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "../camera/brown_conrady.hpp"
#include "../config.hpp"
#include "../error.hpp"
#include "../types.hpp"

namespace turbomap {

/// Pixels are shifted by half a one against the files, so that the centre of the upper left pixel is (0, 0), as in OpenCV;
/// there it is (0.5, 0.5).
struct colmap_camera {
  int width = 0, height = 0;
  brown_conrady<double> model;  ///< of SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL and OPENCV
};
/// A keypoint of an image.
struct colmap_observation {
  vec2<double> pixel;
  std::int64_t point;  ///< id in colmap_model::points, -1: none
};
struct colmap_image {
  std::string name;  ///< of the file
  int camera = 0;    ///< id in colmap_model::cameras
  rigid_transform<double> T_cw;
  std::vector<colmap_observation> observations;
};
struct colmap_model {
  std::map<int, colmap_camera> cameras;
  std::map<int, colmap_image> images;
  std::map<std::int64_t, vec3<double>> points;  ///< world
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The lines of one file that are no comments; failures name the file and the line.
class colmap_lines {
 public:
  explicit colmap_lines(const std::filesystem::path& file) : file_(file.string()), stream_(file) {
    if (!stream_) throw bad_file("turbomap: " + file_ + ": cannot be opened");
  }
  bool next() {
    do {
      if (!std::getline(stream_, text_)) return false;
      ++line_;
      if (!text_.empty() && text_.back() == '\r') text_.pop_back();
    } while (!text_.empty() && text_[0] == '#');
    words_.clear();
    words_.str(text_);
    return true;
  }
  bool blank() const { return text_.find_first_not_of(" \t") == std::string::npos; }
  bool more() { return !(words_ >> std::ws).eof(); }
  template <class T>
  T take(const char* what) {
    T value{};
    if (!(words_ >> value)) fail(std::string("there is no ") + what);
    if constexpr (std::is_floating_point_v<T>)
      if (!std::isfinite(value)) fail(std::string(what) + " is not finite");
    return value;
  }
  [[noreturn]] void fail(const std::string& reason) const {
    throw bad_file("turbomap: " + file_ + ": line " + std::to_string(line_) + ": " + reason);
  }

 private:
  std::string file_, text_;
  std::ifstream stream_;
  std::istringstream words_;
  std::size_t line_ = 0;
};

inline colmap_camera read_colmap_camera(colmap_lines& in) {
  colmap_camera camera;
  brown_conrady<double>& m = camera.model;
  const auto name = in.take<std::string>("model");
  camera.width = in.take<int>("width"), camera.height = in.take<int>("height");
  const bool simple = name.rfind("SIMPLE_", 0) == 0;
  if (name != "SIMPLE_PINHOLE" && name != "PINHOLE" && name != "SIMPLE_RADIAL" && name != "RADIAL" && name != "OPENCV")
    in.fail("camera model " + name + " is not SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL or OPENCV");
  m.fx = in.take<double>("focal length");
  m.fy = simple || name == "RADIAL" ? m.fx : in.take<double>("second focal length");
  m.cx = in.take<double>("cx") - 0.5, m.cy = in.take<double>("cy") - 0.5;
  if (name != "SIMPLE_PINHOLE" && name != "PINHOLE") m.k1 = in.take<double>("k1");
  if (name == "RADIAL" || name == "OPENCV") m.k2 = in.take<double>("k2");
  if (name == "OPENCV") m.p1 = in.take<double>("p1"), m.p2 = in.take<double>("p2");
  if (camera.width <= 0 || camera.height <= 0) in.fail("the image has no size");
  if (!(m.fx > 0) || !(m.fy > 0)) in.fail("a focal length is not positive");
  return camera;
}

inline colmap_image read_colmap_image(colmap_lines& in) {
  colmap_image image;
  auto& T = image.T_cw;
  T.qw = in.take<double>("qw"), T.qx = in.take<double>("qx"), T.qy = in.take<double>("qy"),
  T.qz = in.take<double>("qz");
  T.tx = in.take<double>("tx"), T.ty = in.take<double>("ty"), T.tz = in.take<double>("tz");
  const double norm = std::sqrt(T.qx * T.qx + T.qy * T.qy + T.qz * T.qz + T.qw * T.qw);
  if (!(std::abs(norm - 1) < 1e-2)) in.fail("the rotation is no unit quaternion");
  T.qx /= norm, T.qy /= norm, T.qz /= norm, T.qw /= norm;  // it has few digits
  image.camera = in.take<int>("camera id");
  image.name = in.take<std::string>("file name");
  if (in.next())  // its keypoints; the line may be empty, or missing at the end of a file written by hand
    while (in.more()) {
      const auto x = in.take<double>("x"), y = in.take<double>("y");
      image.observations.push_back({{x - 0.5, y - 0.5}, in.take<std::int64_t>("point id")});
    }
  return image;
}

}  // namespace detail

/// Reads a model. Throws bad_file naming file, line and reason, also for an image of a camera, or an observation of a point,
/// that is not there (the latter only with points3D.txt). Camera models of fisheye lenses are refused.
inline colmap_model read_colmap_model(const std::filesystem::path& folder) {
  colmap_model model;
  detail::colmap_lines cameras(folder / "cameras.txt");
  while (cameras.next())
    if (!cameras.blank()) {
      const int id = cameras.take<int>("camera id");
      model.cameras[id] = detail::read_colmap_camera(cameras);
    }
  const bool with_points = std::filesystem::exists(folder / "points3D.txt");
  if (with_points) {
    detail::colmap_lines points(folder / "points3D.txt");
    while (points.next())
      if (!points.blank()) {
        const auto id = points.take<std::int64_t>("point id");
        const auto x = points.take<double>("x"), y = points.take<double>("y"), z = points.take<double>("z");
        model.points[id] = {x, y, z};
      }
  }
  detail::colmap_lines images(folder / "images.txt");
  while (images.next())
    if (!images.blank()) {
      const int id = images.take<int>("image id");
      const colmap_image& image = model.images[id] = detail::read_colmap_image(images);
      if (model.cameras.count(image.camera) == 0) images.fail("there is no camera " + std::to_string(image.camera));
      for (const colmap_observation& o : image.observations)
        if (with_points && o.point != -1 && model.points.count(o.point) == 0)
          images.fail("there is no point " + std::to_string(o.point));
    }
  if (model.images.empty()) images.fail("there is no image");
  return model;
}

TURBOMAP_END_NAMESPACE
