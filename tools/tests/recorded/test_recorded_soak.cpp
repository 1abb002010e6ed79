// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Recordings to and fro, for as long as you say, through one mapper: each pass comes to the keyframes of the pass before
/// again, with other noise in its pixels, loses a fifth of what they saw, and closes a loop at its end (the whole map is moved,
/// then refresh and fuse_around). The map stays sound, its handles name the keyframes that they were given for, and memory and
/// time per keyframe stay. Only in full builds: see docs/testing.md.
/// TURBOMAP_TEST_SECONDS: how long (10); TURBOMAP_TEST_HOURS: or until so much recorded time; TURBOMAP_TEST_WINDOW: the most
/// keyframes that an adjustment moves; TURBOMAP_TEST_CSV: a folder for figures; TURBOMAP_TEST_RECORDING: one, else all stereo
/// recordings; TURBOMAP_TEST_SEED: of noise and losses.

#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/io/recording.hpp>
#include <turbomap/local_mapper.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>
#include <turbomap/map/validate.hpp>

#include <thrust/execution_policy.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <type_traits>
#include <vector>

#include "recorded_checks.hpp"
#include "replay/recorded_keyframes.hpp"
#include "replay/replayed_map.hpp"
#include "replay/tracking.hpp"
#include "support/environment.hpp"
#include "support/process_memory.hpp"

namespace {

using namespace turbomap_test;
using sequential = std::decay_t<decltype(thrust::seq)>;
using turbomap_replay::orb;

template <class Camera>
class chain {
  using map_type = turbomap::simple_map<orb, Camera>;
  using traits = turbomap::map_traits<map_type>;
  using keyframe = turbomap::map_keyframe_id;
  using point = turbomap::map_point_id;

 public:
  chain(const turbomap::recording& recording, unsigned seed)
      : recording_(recording),
        rig_(turbomap_replay::recorded_rig<Camera>(recording.meta)),
        random_(seed),
        map_(recording.meta.pyramid().levels),
        store_(turbomap_replay::recorded_store_options(recording.meta)),
        tracker_(ctx_, rig_, recording.meta.pyramid(), correlation, false),
        mapper_(ctx_, map_, store_, options(recording.meta), hooks()),
        places_(recording.keyframe_count()) {}

  std::size_t keyframes_in_a_pass() const { return recording_.keyframe_count(); }
  /// Keyframe n of the run; ms of mapping, of processor time: what else the machine does is not growth.
  double step(std::size_t n) {
    const std::size_t count = recording_.keyframe_count(), pass = n / count, in_pass = n % count;
    const std::size_t i = pass % 2 == 0 ? in_pass : count - 1 - in_pass;  // of the recording
    auto data = turbomap_replay::recorded_keyframe(recording_, i, rig_, keypoints_);
    if (pass > 0) disturb();
    const auto T_cw = guess(i);
    const keyframe previous = map_.alive(last_) ? last_ : keyframe{};
    const auto k = map_.add_keyframe(turbomap::span<const turbomap::keypoint>(keypoints_), T_cw,
                                     0.5 * static_cast<double>(n), previous);
    const std::clock_t begin = std::clock();
    mapper_.insert(k, data);
    const std::clock_t inserted = std::clock();
    handles_[traits::id(map_, k)] = mapper_.stored().at(traits::id(map_, k));
    associate(k, i, pass);
    tracker_(map_, k);
    create(k, i);
    const std::clock_t tracked = std::clock();
    const auto& report = mapper_.process(k);
    const std::clock_t end = std::clock();
    CHECK(report.refused.empty());
    last_T_cw_ = map_.alive(k) ? map_.T_cw(k) : T_cw;
    places_[i].now = k, places_[i].seen.clear();
    last_ = k, last_index_ = i;
    if (in_pass + 1 == count) close_loop(k);
    return 1e3 / CLOCKS_PER_SEC * static_cast<double>(end - tracked + (inserted - begin));
  }
  void check() {
    const auto faults = turbomap::validate(map_);
    if (!faults.empty()) CAPTURE(turbomap::to_string(faults[0]));
    CHECK(faults.empty());
    CHECK(store_.statistics().pinned_sets == 0);
    CHECK(store_.statistics().keyframes == map_.keyframe_count());
    CHECK(mapper_.stored().size() == map_.keyframe_count());
    std::size_t wrong = 0;
    for (auto it = handles_.begin(); it != handles_.end();) {
      turbomap::keyframe_handle handle;
      const bool stored = mapper_.stored().find(it->first, handle);
      wrong += stored == store_.contains(it->second) && (!stored || handle == it->second) ? 0 : 1;
      it = stored ? std::next(it) : handles_.erase(it);
    }
    CHECK(wrong == 0);
  }
  std::size_t keyframes() const { return map_.keyframe_count(); }
  std::size_t points() const { return map_.point_count(); }
  std::size_t observations() const { return map_.observation_count(); }

 private:
  static constexpr double correlation = 0.98;
  /// What is known of a keyframe of the recording: its last visit, and, if that has left the map, what it saw.
  struct place {
    keyframe now;
    std::vector<point> seen;
  };

  static turbomap::local_mapper_options options(const turbomap::recording_meta& meta) {
    auto o = turbomap::local_mapper_options::stereo(meta.baseline, meta.close_depth, meta.pyramid());
    o.adjustment.stereo_correlation = o.creation.stereo_correlation = correlation;
    const double window = environment("TURBOMAP_TEST_WINDOW", 0);
    if (window > 0) o.adjustment.most_keyframes = static_cast<int>(window);
    return o;
  }
  turbomap::local_mapper_hooks<map_type> hooks() {
    turbomap::local_mapper_hooks<map_type> h;
    h.erasing = [this](const keyframe& k) {
      for (auto& p : places_)
        if (p.now == k) keep(p);
    };
    return h;
  }
  void keep(place& p) {
    p.seen.clear();
    for (std::size_t n = 0; n < map_.keypoints(p.now).size(); ++n) p.seen.push_back(map_.point_at(p.now, n));
  }
  point point_of(const turbomap::keypoint_reference& ref) const {
    if (ref.keyframe < 0) return {};
    const place& p = places_[static_cast<std::size_t>(ref.keyframe)];
    const auto n = static_cast<std::size_t>(ref.keypoint);
    if (p.now != keyframe{} && map_.alive(p.now)) return map_.point_at(p.now, n);
    return p.seen.empty() || p.seen[n] == point{} ? point{} : turbomap::resolve(map_, p.seen[n]);
  }
  /// Own pose of the keyframe before, and the recorded motion since; at the turn it is the same place.
  turbomap::rigid_transform<double> guess(std::size_t i) const {
    const auto recorded = turbomap::cast<double>(recording_.T_cw[i]);
    if (last_ == keyframe{}) return recorded;
    const auto before = turbomap::cast<double>(recording_.T_cw[last_index_]);
    return turbomap_replay::compose(turbomap_replay::compose(recorded, turbomap_replay::invert(before)),
                                    map_.alive(last_) ? map_.T_cw(last_) : last_T_cw_);
  }
  void disturb() {
    std::uniform_real_distribution<float> noise(-0.3F, 0.3F);
    for (auto& k : keypoints_) {
      const auto inside = [&](float x, float least, float most) { return std::min(std::max(x, least), most - 1); };
      const auto& b = recording_.meta.bounds;
      const float dx = noise(random_);
      k.x = inside(k.x + dx, b.min_x, b.max_x), k.y = inside(k.y + noise(random_), b.min_y, b.max_y);
      if (k.u_right >= 0) k.u_right = std::max(0.F, k.u_right + dx);
    }
  }
  void associate(keyframe k, std::size_t i, std::size_t pass) {
    const auto count = static_cast<std::int32_t>(map_.keypoints(k).size());
    if (pass > 0)
      for (std::int32_t n = 0; n < count; ++n) {
        const point p = point_of({static_cast<std::int32_t>(i), n});
        if (p != point{} && random_() % 5 != 0) turbomap::observe(map_, p, k, static_cast<std::size_t>(n));
      }
    const auto range = recording_.associations(i);
    for (std::size_t row = range.begin; row < range.end; ++row) {
      const auto at = static_cast<std::size_t>(recording_.assoc_kp[row]);
      if (recording_.assoc_new[row] != 0 || map_.point_at(k, at) != point{}) continue;
      point p = point_of(recording_.assoc_ref[row]);
      if (p == point{}) p = point_of(recording_.assoc_ref2[row]);
      if (p != point{}) turbomap::observe(map_, p, k, at);
    }
  }
  void create(keyframe k, std::size_t i) {
    created_.clear();
    const auto range = recording_.associations(i);
    for (std::size_t row = range.begin; row < range.end; ++row) {
      const auto at = static_cast<std::size_t>(recording_.assoc_kp[row]);
      if (recording_.assoc_new[row] == 0 || map_.point_at(k, at) != point{}) continue;
      if (recording_.assoc_ref[row].keypoint != recording_.assoc_kp[row]) {
        const point p = map_.point_at(k, static_cast<std::size_t>(recording_.assoc_ref[row].keypoint));
        if (p != point{}) turbomap::observe(map_, p, k, at);
        continue;
      }
      using turbomap::operator*;
      const auto in_camera = turbomap::to_isometry<double>(turbomap::cast<double>(recording_.T_cw[i])) *
                             turbomap::cast<double>(recording_.assoc_pos[row]);
      const point p = map_.add_point(turbomap::inverse(turbomap::to_isometry<double>(map_.T_cw(k))) * in_camera, k);
      turbomap::observe(map_, p, k, at);
      created_.push_back(p);
    }
    mapper_.watch(created_);
  }
  void close_loop(keyframe k) {
    for (const double shift : {1e-3, -1e-3}) move_everything(shift);
    mapper_.refresh();
    for (auto& p : places_)
      for (auto& seen : p.seen)
        if (seen != point{}) seen = turbomap::resolve(map_, seen);
    map_.forget_replacements();  // names of merged points, which else add up
    if (map_.alive(k)) mapper_.fuse_around(k);
  }
  void move_everything(double shift) {
    traits::for_each_keyframe(map_, [&](keyframe k) {
      auto T = traits::pose(map_, k);
      using turbomap::operator*;
      auto R = turbomap::to_isometry<double>(T);
      R.t = {0, 0, 0};
      const auto t = R * turbomap::vec3<double>{shift, 0, 0};
      T.tx -= t.x, T.ty -= t.y, T.tz -= t.z;
      traits::set_pose(map_, k, T);
    });
    traits::for_each_point(map_, [&](point p) {
      auto x = traits::position(map_, p);
      x.x += shift;
      traits::set_position(map_, p, x);
    });
  }

  const turbomap::recording& recording_;
  std::vector<turbomap::rig_camera<Camera>> rig_;
  std::mt19937 random_;
  turbomap::context<sequential> ctx_;
  map_type map_;
  turbomap::keyframe_store<orb, Camera> store_;
  turbomap_replay::pose_tracker<map_type, sequential> tracker_;
  turbomap::local_mapper<map_type, sequential, turbomap::local_adjustment<map_type, sequential>> mapper_;
  std::vector<place> places_;  ///< by the index of the recording
  std::map<std::uint64_t, turbomap::keyframe_handle> handles_;
  std::vector<turbomap::keypoint> keypoints_;
  std::vector<point> created_;
  keyframe last_;
  turbomap::rigid_transform<double> last_T_cw_;
  std::size_t last_index_ = 0;
};

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

template <class Camera>
void run(const turbomap::recording& recording, const std::string& name, double seconds) {
  const auto seed = static_cast<unsigned>(environment("TURBOMAP_TEST_SEED", 1));
  chain<Camera> c(recording, seed);
  std::ofstream csv;
  if (const char* folder = std::getenv("TURBOMAP_TEST_CSV"))
    csv.open(std::string(folder) + "/soak_" + name + "_" + std::to_string(seed) + ".csv");
  csv << "keyframe,recorded_hours,ms_median,ms_p99,mb,keyframes,points,observations\n";
  const double duration = 1e-9 * static_cast<double>(recording.t_ns.back() - recording.t_ns.front());
  const double hours = environment("TURBOMAP_TEST_HOURS", std::numeric_limits<double>::infinity());
  const auto start = std::chrono::steady_clock::now();
  std::vector<double> ms, medians, memory;
  std::size_t n = 0, pass = 0;
  do {
    ms.clear();
    for (std::size_t i = 0; i < c.keyframes_in_a_pass(); ++i) ms.push_back(c.step(n++));
    ++pass;
    c.check();
    std::vector<double> sorted = ms;
    std::sort(sorted.begin(), sorted.end());
    medians.push_back(median(ms)), memory.push_back(resident_mb());
    csv << n << ',' << static_cast<double>(pass) * duration / 3600 << ',' << medians.back() << ','
        << sorted[sorted.size() * 99 / 100] << ',' << memory.back() << ',' << c.keyframes() << ',' << c.points() << ','
        << c.observations() << std::endl;
  } while (std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() < seconds &&
           static_cast<double>(pass) * duration / 3600 < hours);
  MESSAGE(name << ": " << n << " keyframes, " << static_cast<double>(pass) * duration / 3600 << " hours recorded, "
               << medians.front() << " to " << medians.back() << " ms, " << memory.front() << " to " << memory.back()
               << " MB, " << c.keyframes() << " keyframes left");
  // In the first passes the map comes to hold each place as often as culling lets it.
  constexpr std::size_t settled = 6;
  if (medians.size() < 2 * settled) {
    MESSAGE("fewer than " << 2 * settled << " passes: growth is not looked at; TURBOMAP_TEST_SECONDS gives more time");
    return;
  }
  const auto early = medians.begin() + settled;
  CHECK(median({medians.end() - 3, medians.end()}) < 1.3 * median({early, early + 3}));
  CHECK(memory.back() < 1.1 * memory[settled]);
}

}  // namespace

TEST_CASE("recordings to and fro: memory and time per keyframe stay, and the map is sound") {
  const char* const only = std::getenv("TURBOMAP_TEST_RECORDING");
  const double seconds = environment("TURBOMAP_TEST_SECONDS", 10);
  for (const std::string name : {"euroc_v102_stereo", "tum_room1_stereo"}) {
    if (only != nullptr && name != only) continue;
    const auto directory = data("recordings/" + name);
    if (!directory) continue;
    const auto recording = turbomap::read_recording(*directory);
    if (recording.meta.camera2.empty())
      run<turbomap::pinhole<float>>(recording, name, seconds);
    else
      run<turbomap::kannala_brandt<float>>(recording, name, seconds);
  }
}
