// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// turbomap-extract: data sets that are rendered here, of which every pixel's depth is known; bad ones; EuRoC's layout.

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "support/support.hpp"

#if __has_include(<opencv2/features2d.hpp>)

#include <turbomap/io/colmap_model.hpp>

#include "extraction/extract.hpp"
#include "reference/larger_or_nan.hpp"
#include "rendered_dataset.hpp"
#include "support/files.hpp"

namespace {

namespace ext = turbomap::extraction;
namespace fs = std::filesystem;

turbomap::recording extracted(const fs::path& folder, const ext::dataset_options& data_options,
                              const ext::extract_options& options) {
  const auto data = ext::read_asl_dataset(folder, data_options);
  return ext::extract(data, ext::pick_keyframes(data, options), options, [] {});
}

double median(std::vector<double> values) {
  if (values.empty()) return 1e9;
  std::nth_element(values.begin(), values.begin() + static_cast<long>(values.size() / 2), values.end());
  return values[values.size() / 2];
}
double share_below(const std::vector<double>& values, double bound) {
  const auto below = std::count_if(values.begin(), values.end(), [&](double v) { return v < bound; });
  return static_cast<double>(below) / std::max(1.0, static_cast<double>(values.size()));
}

/// What a recording says, against what its keypoints show in truth.
struct verdict {
  std::vector<double> depth_error;        ///< relative, of keypoints with a depth
  std::vector<double> association_error;  ///< m between what two keypoints of one point show
  std::size_t created = 0;

  verdict(const turbomap::recording& r, const turbomap_test::rendered_dataset& d) {
    const auto rig = ext::image_rectifier(cameras(r, d)).rig();
    const auto shown = [&](std::size_t i, std::size_t k, Eigen::Vector3d& hit, double& depth) {
      const std::size_t row = r.keypoints(i).begin + k;
      const std::size_t c = r.nleft[i] >= 0 && k >= static_cast<std::size_t>(r.nleft[i]) ? 1 : 0;
      const Eigen::Isometry3d T_wc = d.T_wb[static_cast<std::size_t>(r.frame_id[i])] * rig.cameras[c].T_bc;
      const Eigen::Vector3d ray = rig.cameras[c].unproject({r.kp_xy[row].x, r.kp_xy[row].y});
      bool on_panel = false;
      if (!turbomap_test::cast_ray(T_wc.translation(), T_wc.linear() * ray, hit, on_panel)) return false;
      depth = (T_wc.inverse() * hit).z();
      return true;
    };
    Eigen::Vector3d here, there;
    double depth = 0, other = 0;
    for (std::size_t i = 0; i < r.keyframe_count(); ++i) {
      for (std::size_t k = 0; k < r.keypoints(i).size(); ++k) {
        const float measured = r.kp_depth[r.keypoints(i).begin + k];
        if (measured > 0) depth_error.push_back(shown(i, k, here, depth) ? std::abs(measured / depth - 1) : 1);
      }
      const auto rows = r.associations(i);
      for (std::size_t row = rows.begin; row < rows.end; ++row) {
        if (r.assoc_new[row] != 0) {
          ++created;
          continue;
        }
        const auto seen = r.assoc_ref[row];
        const bool known =
            shown(i, static_cast<std::size_t>(r.assoc_kp[row]), here, depth) &&
            shown(static_cast<std::size_t>(seen.keyframe), static_cast<std::size_t>(seen.keypoint), there, other);
        association_error.push_back(known ? (here - there).norm() : 1);
      }
    }
    MESSAGE(depth_error.size() << " depths, median error " << median(depth_error)
                               << ", within 3 %: " << share_below(depth_error, 0.03) << "; " << association_error.size()
                               << " associations, median " << median(association_error) << " m, within 5 cm: "
                               << share_below(association_error, 0.05) << "; " << created << " new");
  }
  static std::vector<ext::calibrated_camera> cameras(const turbomap::recording& r,
                                                     const turbomap_test::rendered_dataset& d) {
    auto all = d.cameras;
    if (r.meta.sensor == "monocular") all.resize(1);
    return all;
  }
};

}  // namespace

TEST_CASE("a rendered pinhole pair: depths and associations are those of the scene") {
  const turbomap_test::temporary_directory folder;
  const auto truth = turbomap_test::write_dataset(folder.path(), false, 6);
  const auto r = extracted(folder.path(), {}, {});
  CHECK(r.keyframe_count() == 6);
  CHECK(r.meta.sensor == "stereo");
  CHECK(r.meta.model == "Pinhole");
  CHECK(r.meta.baseline == doctest::Approx(0.11).epsilon(0.01));
  const verdict v(r, truth);
  CHECK(v.depth_error.size() > r.kp_xy.size() / 3);
  CHECK(median(v.depth_error) < 0.005);
  CHECK(share_below(v.depth_error, 0.03) > 0.95);
  CHECK(v.association_error.size() > 1000);
  CHECK(share_below(v.association_error, 0.05) > 0.95);
  CHECK(r.gt_T_wb.size() == 6);

  SUBCASE("what is written is read back") {
    const auto out = folder / "recording";
    turbomap::write_recording(out, r);
    CHECK(turbomap::read_recording(out).assoc_kp == r.assoc_kp);
  }
  SUBCASE("with drift: the same images, other poses, the same for one seed") {
    ext::extract_options drifting;
    drifting.motion.drift_metres_per_metre = 0.05;
    const auto a = extracted(folder.path(), {}, drifting), b = extracted(folder.path(), {}, drifting);
    drifting.seed = 2;
    const auto c = extracted(folder.path(), {}, drifting);
    const auto x = [](const turbomap::recording& of) { return of.T_cw.back().tx; };
    CHECK(a.kp_depth == r.kp_depth);
    CHECK(x(a) == x(b));
    CHECK(x(a) != x(c));
    CHECK(x(a) != x(r));
    CHECK(std::abs(x(a) - x(r)) < 0.1);
  }
  SUBCASE("with its IMU") {
    ext::dataset_options with_imu;
    with_imu.imu = true;
    const auto inertial = extracted(folder.path(), with_imu, {});
    CHECK(inertial.meta.sensor == "inertial");
    CHECK(inertial.imu.size() == 6);
    CHECK(inertial.imu[0].acceleration.z == 9.81);
    CHECK(inertial.meta.imu_noise_variance.at(0) == doctest::Approx(0.001 * 0.001 * 200));
  }
  SUBCASE("one camera: points of two keyframes") {
    ext::dataset_options mono;
    mono.mono = true;
    const auto single = extracted(folder.path(), mono, {});
    CHECK(single.meta.sensor == "monocular");
    const verdict of_mono(single, truth);
    CHECK(of_mono.depth_error.empty());
    CHECK(of_mono.created > 100);
    CHECK(of_mono.association_error.size() > 500);
    CHECK(share_below(of_mono.association_error, 0.05) > 0.95);
  }
  SUBCASE("features are in all cells that have texture") {
    const ext::feature_options options;
    std::vector<int> cells(static_cast<std::size_t>(options.columns * options.rows));
    const auto rows = r.keypoints(0);
    for (std::size_t row = rows.begin; row < rows.end; ++row)
      ++cells[static_cast<std::size_t>(r.kp_xy[row].y * static_cast<float>(options.rows) / 480) *
                  static_cast<std::size_t>(options.columns) +
              static_cast<std::size_t>(r.kp_xy[row].x * static_cast<float>(options.columns) / 752)];
    CHECK(*std::max_element(cells.begin(), cells.end()) <= options.per_cell + 2);  // moved between cells by a pixel
    CHECK(std::count(cells.begin(), cells.end(), 0) < 40);                         // ORB leaves 31 px at each side free
  }
}

TEST_CASE("a rendered fisheye pair") {
  const turbomap_test::temporary_directory folder;
  const auto truth = turbomap_test::write_dataset(folder.path(), true, 4);
  const auto r = extracted(folder.path(), {}, {});
  CHECK(r.meta.model == "KannalaBrandt8");
  CHECK(r.nleft[0] > 0);
  const verdict v(r, truth);
  CHECK(v.depth_error.size() > 200);
  CHECK(median(v.depth_error) < 0.15);  // half a pixel of a disparity of 6: corners alone, no correlation
  CHECK(v.association_error.size() > 400);
  CHECK(share_below(v.association_error, 0.1) > 0.9);

  SUBCASE("as TUM-VI publishes it: motion capture, and one file of calibration") {
    fs::rename(folder / "mav0/state_groundtruth_estimate0", folder / "mav0/mocap0");
    fs::create_directories(folder / "dso");
    std::ofstream chain(folder / "dso/camchain.yaml");
    chain << std::setprecision(17);
    for (std::size_t c = 0; c < 2; ++c) {
      const auto& camera = truth.cameras[c].camera;
      const auto k = camera.parameters();
      const Eigen::Matrix4d T_cb = camera.T_bc.inverse().matrix();
      chain << "cam" << c << ":\n  T_cam_imu:\n";
      for (int row = 0; row < 4; ++row)
        chain << "  - [" << T_cb(row, 0) << ", " << T_cb(row, 1) << ", " << T_cb(row, 2) << ", " << T_cb(row, 3)
              << "]\n";
      chain << "  camera_model: pinhole\n  distortion_coeffs: [" << k[4] << ", " << k[5] << ", " << k[6] << ", " << k[7]
            << "]\n  distortion_model: equidistant\n  intrinsics: [" << k[0] << ", " << k[1] << ", " << k[2] << ", "
            << k[3] << "]\n  resolution: [" << camera.width << ", " << camera.height << "]\n";
      fs::remove(folder / (c == 0 ? "mav0/cam0/sensor.yaml" : "mav0/cam1/sensor.yaml"));
    }
    chain.close();
    const auto same = extracted(folder.path(), {}, {});
    CHECK(same.nleft == r.nleft);
    REQUIRE(same.kp_depth.size() == r.kp_depth.size());
    double worst = 0;
    for (std::size_t k = 0; k < r.kp_depth.size(); ++k)
      worst = turbomap_test::larger_or_nan(worst, std::abs(same.kp_depth[k] - r.kp_depth[k]));
    CHECK(worst < 1e-3);
    for (std::size_t i = 0; i < r.keyframe_count(); ++i) {
      CHECK(same.T_cw[i].tx == doctest::Approx(r.T_cw[i].tx).epsilon(1e-6));
      CHECK(same.T_cw[i].qy == doctest::Approx(r.T_cw[i].qy).epsilon(1e-6));
    }
  }
}

TEST_CASE("pairs of two views: a best descriptor is compared with the second best that there is") {
  turbomap::simulation::simulated_camera camera;
  camera.model = turbomap::pinhole<double>{200, 200, 160, 120};
  camera.width = 320, camera.height = 240;
  Eigen::Isometry3d T_ab = Eigen::Isometry3d::Identity();
  T_ab.translation().x() = 0.1;
  const auto bits = [](int count) {
    turbomap::descriptor_bytes d{};
    for (int i = 0; i < count; ++i)
      d[static_cast<std::size_t>(i / 8)] = static_cast<std::uint8_t>(d[static_cast<std::size_t>(i / 8)] | 1 << i % 8);
    return d;
  };
  turbomap::keypoint in_a, in_b;  // of a point 1 m ahead of the first view
  in_a.x = 160, in_b.x = 140, in_a.y = in_b.y = 120;
  const auto pairs = [&](const std::vector<int>& distances) {
    ext::image_features a, b;
    a.keypoints = {in_a}, a.descriptors = {bits(0)};
    for (const int d : distances) b.keypoints.push_back(in_b), b.descriptors.push_back(bits(d));
    return ext::view_pairs({a, camera}, {b, camera}, T_ab, 1.2F, {});
  };
  for (const auto& distances : {std::vector<int>{45, 90}, {45}, {50, 63}}) {
    const auto found = pairs(distances);
    REQUIRE(found.size() == 1);
    CHECK(found[0].b == 0);
    CHECK((found[0].point - Eigen::Vector3d(0, 0, 1)).norm() < 1e-9);
  }
  REQUIRE(pairs({90, 45}).size() == 1);
  CHECK(pairs({90, 45})[0].b == 1);
  CHECK(pairs({45, 56}).empty());  // 45 > 0.8 * 56
  CHECK(pairs({51}).empty());
  CHECK(pairs({}).empty());
}

TEST_CASE("keyframes come by time, way and turn, and only where there is a pose") {
  ext::asl_dataset data;
  data.cameras.resize(2);
  const auto at = [](double x, double angle) {
    const Eigen::Quaterniond q(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
    return turbomap::rigid_transform<double>{q.x(), q.y(), q.z(), q.w(), x, 0, 0};
  };
  for (int i = 0; i < 40; ++i) data.images.push_back({std::int64_t{50000000} * i, "", ""});
  data.T_wb = {{100000000, at(0, 0)},  {300000000, at(0, 0)},  {500000000, at(2, 0)}, {700000000, at(2, 2)},
               {1000000000, at(2, 2)}, {1800000000, at(2, 2)}, {1900000000, at(2, 2)}};
  const auto picked = ext::pick_keyframes(data, {});
  std::vector<std::size_t> images;
  for (const auto& k : picked.keyframes) images.push_back(k.image);
  // 2: the first pose. 7..10: half a metre each. 11..14: half a radian each. 36: after a gap without poses.
  CHECK(images == std::vector<std::size_t>{2, 7, 8, 9, 10, 11, 12, 13, 14, 36});
  CHECK(picked.posed.size() == 22);
  data.T_wb = {{-5, at(0, 0)}};
  CHECK_THROWS_WITH(ext::pick_keyframes(data, {}), doctest::Contains("there is a pose for none of the images"));
}

TEST_CASE("bad data sets are refused by name") {
  const turbomap_test::temporary_directory folder;
  const auto message = [&](const ext::dataset_options& options = {}) {
    return turbomap_test::bad_file_message([&] { extracted(folder.path(), options, {}); });
  };
  const auto has = [](const std::string& text, const char* part) {
    INFO(text);
    return text.find(part) != std::string::npos;
  };
  CHECK(has(message(), "there is no mav0/cam0/data.csv"));
  turbomap_test::write_dataset(folder.path(), false, 1);
  const auto cam0 = folder / "mav0/cam0/data.csv", cam1 = folder / "mav0/cam1/data.csv";
  const std::string list = turbomap_test::file_bytes(cam0), other = turbomap_test::file_bytes(cam1);
  turbomap_test::write_bytes(cam0, "#t\nabc,x.png\n");
  CHECK(has(message(), "line 2: 'abc' is not a time"));
  turbomap_test::write_bytes(cam0, "5\n");
  CHECK(has(message(), "fewer than 1 fields"));
  turbomap_test::write_bytes(cam0, "5,x\n5,y\n");
  CHECK(has(message(), "line 2: is not later"));
  turbomap_test::write_bytes(cam0, "#t\n");
  CHECK(has(message(), "no line with data"));
  turbomap_test::write_bytes(cam0, "5,x.png\n");
  CHECK(has(message(), "no images of cam0 and cam1 have the same time"));
  turbomap_test::write_bytes(cam0, list);
  fs::remove(cam1);
  CHECK(has(message(), "there is no cam1"));
  turbomap_test::write_bytes(cam1, other);
  const auto sensor = folder / "mav0/cam1/sensor.yaml", truth = folder / "mav0/state_groundtruth_estimate0/data.csv";
  const std::string calibration = turbomap_test::file_bytes(sensor), poses = turbomap_test::file_bytes(truth);
  turbomap_test::write_bytes(sensor, "resolution: [752, 480]\n");
  CHECK(has(message(), "intrinsics needs 4 numbers"));
  turbomap_test::write_bytes(sensor, turbomap_test::file_bytes(folder / "mav0/cam0/sensor.yaml"));
  CHECK(has(message(), "cam0 and cam1 are at one place"));
  turbomap_test::write_bytes(sensor, calibration);
  turbomap_test::write_bytes(truth, list.substr(0, 19) + ",0,0,0,1,1,0,0\n");
  CHECK(has(message(), "not a unit quaternion"));
  turbomap_test::write_bytes(truth, list.substr(0, 19) + ",0,0,zero,1,0,0,0\n");
  CHECK(has(message(), "'zero' is not a number"));
  fs::remove(truth);
  CHECK(has(message(), "there is no ground truth"));
  turbomap_test::write_bytes(truth, poses);
  ext::dataset_options imu;
  imu.imu = true;
  fs::remove(folder / "mav0/imu0/data.csv");
  CHECK(has(message(imu), "imu0/data.csv: cannot be opened"));
  for (const auto& file : fs::directory_iterator(folder / "mav0/cam0/data"))
    turbomap_test::write_bytes(file, "no image");
  CHECK(has(message(), "is not an image that can be read"));
}

TEST_CASE("the noise of the IMU: of the Kalibr file, of sensor.yaml, or of a data set of its kind") {
  const turbomap_test::temporary_directory folder;
  turbomap_test::write_dataset(folder.path(), false, 1);
  ext::dataset_options options;
  options.imu = true, options.mono = true;
  const auto noise = [&] { return ext::read_asl_dataset(folder.path(), options).noise; };
  CHECK(noise().gyro == 0.001);
  options.calibration = folder / "kalibr.yaml";
  const std::string camera =
      "cam0:\n  intrinsics: [458, 457, 367, 248]\n  resolution: [752, 480]\n  distortion_model: radtan\n"
      "  distortion_coeffs: [0, 0, 0, 0]\n  T_imu_cam: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n";
  turbomap_test::write_bytes(options.calibration, camera);
  CHECK(noise().gyro == 0.001);
  turbomap_test::write_bytes(options.calibration,
                             camera + "imu0:\n  gyroscope_noise_density: 0.002\n  update_rate: 400\n");
  CHECK(noise().gyro == 0.002);
  CHECK(noise().rate_hz == 400);
  turbomap_test::write_bytes(options.calibration, camera + "imu0:\n  gyroscope_noise_density: -1\n");
  CHECK_THROWS_WITH(noise(), doctest::Contains("kalibr.yaml: imu0: gyroscope_noise_density"));
  fs::remove(folder / "mav0/imu0/sensor.yaml");
  options.calibration.clear();
  CHECK(noise().gyro == turbomap::simulation::euroc_rig().imu.gyro);
  turbomap_test::write_dataset(folder.path(), true, 1);
  fs::remove(folder / "mav0/imu0/sensor.yaml");
  CHECK(noise().gyro == turbomap::simulation::tum_vi_rig().imu.gyro);
}

TEST_CASE("photographs: pairs of two views lie at the depth of their COLMAP model") {
  const auto data = turbomap_test::data("lund-door");
  if (!data) return;
  const auto model = turbomap::read_colmap_model(*data / "colmap_ground_truth");
  turbomap::simulation::simulated_camera camera;
  std::vector<ext::image_features> features;
  std::vector<Eigen::Isometry3d> T_cw;
  cv::Matx33d K;
  const std::vector<double> lens{-0.0336422, 0, 0, 0};  // SIMPLE_RADIAL, as cameras.txt has it
  for (const std::int32_t id : {4, 5}) {
    const auto& image = model.images.at(id);
    const auto& k = model.cameras.at(image.camera);
    camera.model = turbomap::pinhole<double>{2435.38, 2435.38, 648, 968};
    camera.width = k.width, camera.height = k.height;
    K = {2435.38, 0, 648, 0, 2435.38, 968, 0, 0, 1};
    cv::Mat undistorted;
    const cv::Mat raw =
        cv::imread((*data / "images" / image.name).string(), cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
    REQUIRE(raw.cols == k.width);
    cv::undistort(raw, undistorted, K, lens);
    ext::feature_options options;
    options.per_cell = 40;
    features.push_back(ext::grid_features(options)(undistorted));
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::Quaterniond(image.T_cw.qw, image.T_cw.qx, image.T_cw.qy, image.T_cw.qz).toRotationMatrix();
    T.translation() = Eigen::Vector3d(image.T_cw.tx, image.T_cw.ty, image.T_cw.tz);
    T_cw.push_back(T);
  }
  const auto pairs =
      ext::view_pairs({features[0], camera}, {features[1], camera}, T_cw[0] * T_cw[1].inverse(), 1.2F, {});
  std::vector<double> error;
  for (const auto& pair : pairs) {
    const auto& z = features[0].keypoints[static_cast<std::size_t>(pair.a)];
    double nearest = 4, depth = 0;  // px: a point of the model says how deep the keypoint is
    for (const auto& [id, point] : model.points) {
      const Eigen::Vector3d x = T_cw[0] * Eigen::Vector3d(point.x, point.y, point.z);
      Eigen::Vector2d pixel;
      if (!camera.project(x, pixel)) continue;
      const double d = std::hypot(pixel.x() - z.x, pixel.y() - z.y);
      if (d < nearest) nearest = d, depth = x.z();
    }
    if (depth > 0) error.push_back(std::abs(pair.point.z() / depth - 1));
  }
  MESSAGE(pairs.size() << " pairs; depth of " << error.size() << " off by " << median(error)
                       << " (median), within 3 %: " << share_below(error, 0.03));
  CHECK(pairs.size() > 500);
  CHECK(error.size() > 100);
  CHECK(median(error) < 0.01);
  CHECK(share_below(error, 0.03) > 0.85);
}

TEST_CASE("photographs as a data set of one camera: points lie as deep as their COLMAP model has them") {
  const auto data = turbomap_test::data("lund-door");
  if (!data) return;
  const auto model = turbomap::read_colmap_model(*data / "colmap_ground_truth");
  const turbomap_test::temporary_directory folder;
  const fs::path mav = folder / "mav0";
  fs::create_directories(mav / "cam0/data"), fs::create_directories(mav / "state_groundtruth_estimate0");
  std::ofstream list(mav / "cam0/data.csv"), truth(mav / "state_groundtruth_estimate0/data.csv");
  truth << std::setprecision(17);
  std::vector<Eigen::Isometry3d> T_cw;
  std::vector<const turbomap::colmap_image*> images;
  for (const auto& [id, image] : model.images) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::Quaterniond(image.T_cw.qw, image.T_cw.qx, image.T_cw.qy, image.T_cw.qz).toRotationMatrix();
    T.translation() = Eigen::Vector3d(image.T_cw.tx, image.T_cw.ty, image.T_cw.tz);
    T_cw.push_back(T), images.push_back(&image);
    const Eigen::Isometry3d T_wc = T.inverse();
    const Eigen::Quaterniond q(T_wc.linear());
    const auto& x = T_wc.translation();
    fs::create_symlink(fs::absolute(*data / "images" / image.name), mav / "cam0/data" / image.name);
    list << id << "000000000," << image.name << '\n';
    truth << id << "000000000," << x.x() << ',' << x.y() << ',' << x.z() << ',' << q.w() << ',' << q.x() << ',' << q.y()
          << ',' << q.z() << '\n';
  }
  list.close(), truth.close();
  turbomap_test::write_bytes(mav / "cam0/sensor.yaml",
                             "T_BS:\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n"
                             "resolution: [1296, 1936]\nintrinsics: [2435.38, 2435.38, 648, 968]\n"
                             "distortion_model: radial-tangential\ndistortion_coefficients: [-0.0336422, 0, 0, 0]\n");
  ext::dataset_options mono;
  mono.mono = true;
  ext::extract_options options;
  options.features.per_cell = 24;
  const auto r = extracted(folder.path(), mono, options);
  CHECK(r.meta.sensor == "monocular");
  REQUIRE(r.keyframe_count() == model.images.size());

  std::vector<double> error;
  std::size_t again = 0;
  for (std::size_t i = 0; i < images.size(); ++i) {
    std::vector<Eigen::Vector3d> shown;  // pixel and depth of what the model's image shows
    for (const auto& seen : images[i]->observations) {
      if (seen.point < 0) continue;
      const auto& point = model.points.at(seen.point);
      const Eigen::Vector3d x = T_cw[i] * Eigen::Vector3d(point.x, point.y, point.z);
      shown.emplace_back(2435.38 * x.x() / x.z() + 648, 2435.38 * x.y() / x.z() + 968, x.z());
    }
    const Eigen::Isometry3d T_cr = T_cw[i] * T_cw[0].inverse();  // the recording's world is the first camera
    for (std::size_t row = r.associations(i).begin; row < r.associations(i).end; ++row) {
      again += r.assoc_new[row] == 0 ? 1 : 0;
      const auto& z = r.kp_xy[r.keypoints(i).begin + static_cast<std::size_t>(r.assoc_kp[row])];
      const auto& at = r.assoc_pos[row];
      double nearest = 4, depth = 0;  // px
      for (const auto& s : shown)
        if (const double d = std::hypot(s.x() - z.x, s.y() - z.y); d < nearest) nearest = d, depth = s.z();
      if (depth > 0) error.push_back(std::abs((T_cr * Eigen::Vector3d(at.x, at.y, at.z)).z() / depth - 1));
    }
  }
  MESSAGE(again << " associations with points of earlier photographs; depth of " << error.size() << " off by "
                << median(error) << " (median), within 3 %: " << share_below(error, 0.03));
  CHECK(again > 5000);
  CHECK(error.size() > 1500);
  CHECK(median(error) < 0.01);
  CHECK(share_below(error, 0.03) > 0.85);
}

TEST_CASE("EuRoC's layout: the camera at rest") {
  const auto data = turbomap_test::data("euroc-layout");
  if (!data) return;
  const turbomap_test::temporary_directory folder;
  ext::dataset_options options;
  options.trajectory = folder / "rest.txt";
  turbomap_test::write_bytes(options.trajectory,
                             "1403715273.262142976 0 0 0 0 0 0 1\n1403715275.262142976 0 0 0 0 0 0 1\n");
  ext::extract_options extract;
  extract.pose_gap_s = 3;
  const auto r = extracted(*data, options, extract);
  CHECK(r.keyframe_count() == 3);
  // The recorded system's pair is of the same cameras, rectified by another version (recordings/euroc_v102_stereo/meta.json).
  CHECK(r.meta.baseline == doctest::Approx(0.110077843).epsilon(1e-5));
  CHECK(r.meta.camera1.at(0) == doctest::Approx(435.204681).epsilon(0.01));
  // What rests stays where it is, and at its depth.
  std::vector<double> moved, depth;
  for (std::size_t i = 1; i < 3; ++i)
    for (std::size_t row = r.associations(i).begin; row < r.associations(i).end; ++row) {
      if (r.assoc_new[row] != 0) continue;
      const auto ref = r.assoc_ref[row];
      const std::size_t a = r.keypoints(i).begin + static_cast<std::size_t>(r.assoc_kp[row]);
      const std::size_t b =
          r.keypoints(static_cast<std::size_t>(ref.keyframe)).begin + static_cast<std::size_t>(ref.keypoint);
      moved.push_back(std::hypot(r.kp_xy[a].x - r.kp_xy[b].x, r.kp_xy[a].y - r.kp_xy[b].y));
      if (r.kp_depth[a] > 0 && r.kp_depth[b] > 0) depth.push_back(std::abs(r.kp_depth[a] / r.kp_depth[b] - 1.0));
    }
  MESSAGE(moved.size() << " associations move by " << median(moved) << " px, depth by " << median(depth)
                       << " (median)");
  CHECK(moved.size() > 300);
  CHECK(median(moved) < 1);
  CHECK(median(depth) < 0.02);
}

#endif
