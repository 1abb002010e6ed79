// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// ORB features of two photographs with known poses -> correspondences -> map points.
///
///     01_match_two_images                          two photographs of TURBOMAP_DATA_DIR, or two rendered images, which it
///                                                  leaves as one.png and two.png
///     01_match_two_images ONE TWO MODEL            your photographs; MODEL has cameras.txt and images.txt as COLMAP writes
///
/// Writes matches.png and points.ply into the current folder. Exit status 0 when the result is sane, 1 when not, 2
/// where a file cannot be read or written.

#include <thrust/execution_policy.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <opencv2/features2d.hpp>
#include <turbomap/camera/full_image_keypoint.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/context.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/interop/opencv.hpp>
#include <turbomap/matching/correspondence_search.hpp>
#include <turbomap/matching/point_creation.hpp>
#include <turbomap/store/keyframe_store.hpp>

#include "two_views.hpp"

namespace {

using descriptor = turbomap::binary_descriptor<256>;  // ORB's
using camera = turbomap::pinhole<float>;

/// What a keyframe is made of.
struct features {
  std::vector<cv::KeyPoint> raw;              // as found: for drawing
  std::vector<turbomap::keypoint> keypoints;  // undistorted
  cv::Mat descriptors;
};

/// Keypoints are undistorted here, once, and the keyframe's camera is a pinhole: epipolar lines are straight then, and the
/// test of a candidate is a few multiplications instead of a triangulation. For ordinary lenses that finds the same matches in
/// half the time (docs/evaluation.md). With a wide or a fisheye lens give raw pixels and the lens's own model instead.
features find_features(const example::view& view, const camera& pinhole) {
  features f;
  cv::ORB::create(4000)->detectAndCompute(view.image, {}, f.raw, f.descriptors);
  f.keypoints = turbomap::keypoints_from_opencv(f.raw);
  for (turbomap::keypoint& k : f.keypoints) {
    k = turbomap::in_full_image(k, view.image.cols, view.image.rows, 1.2F);  // ORB's pixels of coarser levels are off
    turbomap::vec3<double> ray{};
    turbomap::vec2<double> pixel{k.x, k.y};
    if (!view.camera.unproject(pixel, ray) || !pinhole.project(ray, pixel))
      throw std::runtime_error("a pixel has no ray");
    k.x = static_cast<float>(pixel.x), k.y = static_cast<float>(pixel.y);
  }
  return f;
}

void write_image(const char* file, const cv::Mat& image) {
  if (!cv::imwrite(file, image)) throw std::runtime_error(std::string(file) + " cannot be written");
}

void write_ply(const char* file, const std::vector<turbomap::created_point>& points, const example::view& view,
               const features& f) {
  std::ofstream out(file);
  out << "ply\nformat ascii 1.0\nelement vertex " << points.size()
      << "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\n"
         "property uchar blue\nend_header\n";
  for (const auto& p : points) {
    const int gray = view.image.at<std::uint8_t>(f.raw[static_cast<std::size_t>(p.query)].pt);
    out << p.position.x << ' ' << p.position.y << ' ' << p.position.z << ' ' << gray << ' ' << gray << ' ' << gray
        << '\n';
  }
  if (!out.flush()) throw std::runtime_error(std::string(file) + " cannot be written");
}

int run(const std::vector<example::view>& views, bool rendered) {
  // Two keyframes, inserted once; a SLAM system searches them many times.
  turbomap::keyframe_store<descriptor, camera> store;
  std::vector<turbomap::keyframe_handle> handles;
  std::vector<features> found;
  for (const example::view& v : views) {
    const camera pinhole{float(v.camera.fx), float(v.camera.fy), float(v.camera.cx), float(v.camera.cy)};
    const features& f = found.emplace_back(find_features(v, pinhole));
    const auto rig = turbomap::make_mono_rig(pinhole);
    turbomap::keyframe_data<descriptor, camera> data;
    data.keypoint_count = static_cast<int>(f.keypoints.size());
    data.keypoints = f.keypoints.data();
    data.descriptors = turbomap::descriptors_from_opencv<descriptor>(f.descriptors).data();
    data.cameras = rig.cameras;
    data.camera_count = rig.size();
    data.bounds = turbomap::bounds_of(f.keypoints);
    handles.push_back(store.insert(data));
  }

  // Search, then create: both stay where the policy computes, until their plans are asked for.
  turbomap::context ctx{thrust::host};
  const auto pinned = store.pin(ctx, handles);
  using posed = turbomap::posed_keyframe<descriptor, camera>;
  const posed query{pinned[0], views[0].T_cw, {}};
  const std::vector<posed> neighbours{{pinned[1], views[1].T_cw, {}}};
  const auto matches = turbomap::search_correspondences(ctx, query, turbomap::span<const posed>(neighbours));
  turbomap::point_creation creation(ctx);
  turbomap::create_points(ctx, matches, {}, creation);
  const auto plan = creation.plan(ctx, matches);  // every match with its outcome
  const auto points = turbomap::first_claims(plan, pinned[0].keypoint_count, {pinned[1].keypoint_count});

  std::vector<cv::DMatch> lines;
  for (const auto& p : points) lines.emplace_back(p.query, p.candidate, 0.0F);
  cv::Mat drawn;
  cv::drawMatches(views[0].image, found[0].raw, views[1].image, found[1].raw, lines, drawn);
  write_image("matches.png", drawn);
  write_ply("points.ply", points, views[0], found[0]);
  std::printf("%d and %d keypoints, %zu matches, %zu points: see matches.png, points.ply\n", pinned[0].keypoint_count,
              pinned[1].keypoint_count, plan.size(), points.size());

  bool good = points.size() >= 100;
  if (rendered && good) {  // here the truth is known
    std::vector<double> error;
    for (const auto& p : points) error.push_back(example::distance_to_room(p.position));
    std::nth_element(error.begin(), error.begin() + error.size() / 2, error.end());
    std::printf("median distance of the points to the walls of the room, 4 to 7 m away: %.1f cm\n",
                100 * error[error.size() / 2]);
    good = error[error.size() / 2] < 0.1;
  }
  return good ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc == 4) return run(example::read_views({argv[1], argv[2]}, argv[3]), false);
  if (argc != 1) throw std::invalid_argument("usage: 01_match_two_images [ONE TWO MODEL]");
  const char* data = std::getenv("TURBOMAP_DATA_DIR");
  const std::string door = data == nullptr ? "" : std::string(data) + "/lund-door";
  if (data == nullptr || !std::filesystem::exists(door)) {
    const auto views = example::render_views();
    write_image("one.png", views[0].image);  // both can be given as photographs of one's own
    write_image("two.png", views[1].image);
    return run(views, true);
  }
  return run(example::read_views({door + "/images/DSC_0005.JPG", door + "/images/DSC_0007.JPG"},
                                 door + "/colmap_ground_truth"),
             false);
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
