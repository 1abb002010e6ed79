// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Recording a map that is edited meanwhile, whose numbers are hostile and whose traits lie: what a plain reading of the
// recorder's rules refuses is refused when it is added, and leaves nothing behind; all else is recorded, can be written, and
// is the same when it is read again.

#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <turbomap/io/map_recorder.hpp>
#include <turbomap/map/map_edit.hpp>

#include "hostile.hpp"
#include "recording_contents.hpp"
#include "scenes/lying_map.hpp"
#include "scenes/recording_samples.hpp"
#include "support/files.hpp"

using namespace turbomap_fuzz;

namespace {

using turbomap_test::lying_map;
using traits = turbomap::map_traits<lying_map>;
using keyframe = turbomap::map_keyframe_id;
using point = turbomap::map_point_id;
using data_type = turbomap::keyframe_data<traits::descriptor, traits::camera>;
using reference = std::pair<std::int32_t, std::int32_t>;  ///< keyframe, keypoint
using recent_points = std::vector<turbomap::recorded_recent_point>;

turbomap::recording_meta draw_meta(choices& c) {
  auto m = turbomap_test::small_meta(c.flag());
  m.sensor = c.byte() % 16 == 15 ? "inertial" : "stereo";
  m.events.clear(), m.snapshots.clear();
  if (c.byte() % 4 != 3) return m;
  const double x = c.number(1000);
  switch (c.byte() % 8) {
    case 0:
      m.camera1[c.below(m.camera1.size())] = x;
      break;
    case 1:
      m.T_lr.qw = static_cast<float>(x);
      break;
    case 2:
      m.scale_factors[c.below(m.scale_factors.size())] = c.single(4);
      break;
    case 3:
      m.levels = static_cast<int>(c.below(300)) - 20;
      break;
    case 4:
      m.bounds.max_x = c.single(1000);
      break;
    case 5:
      m.sensor = std::string(1, static_cast<char>(c.byte()));
      break;
    case 6:
      m.ate_kf_rmse_m = x;
      break;
    default:
      m.bf = x;
  }
  return m;
}

class world {
 public:
  world(turbomap::recording_meta meta, choices& c)
      : pair_(!meta.camera2.empty()), levels_(meta.levels), recorder_(std::move(meta)) {
    for (int n = 0; n < 2; ++n) add_keyframe(c);
    for (int n = 0; n < 3; ++n) points_.push_back(map_.add_point({1, 2, 3}, any_keyframe(c)));
    for (int n = 0; n < 12; ++n) observe(c);
  }
  void run(choices& c) {
    for (unsigned n = 4 + c.byte() % 12; n > 0; --n) {
      const unsigned what = c.byte() % 8;
      if (what == 2 || what == 5) map_.tell_the_truth();  // edits of a map that lies: map_faults
      if (what == 0) add_keyframe(c);
      if (what == 1) add_point(c);
      if (what == 2) edit(c);
      if (what == 3) lie(c);
      if (what == 4) add_timed(c);
      for (unsigned views = what == 5 ? 1 + c.byte() % 4 : 0; views > 0; --views) observe(c);
      record(any_keyframe(c), c);
    }
    if (c.byte() % 4 == 0) write();  // takes most of the time
  }

 private:
  keyframe any_keyframe(choices& c) const { return keyframes_[c.below(keyframes_.size())]; }
  point any_point(choices& c) const { return points_[c.below(points_.size())]; }

  void add_keyframe(choices& c) {
    auto keypoints = turbomap_test::random_keypoints(c.byte(), pair_ ? 2 : 1, 8, static_cast<int>(c.below(4)));
    for (auto& k : keypoints) {  // most are sound
      if (c.byte() % 8 == 7) continue;
      for (float* x : {&k.x, &k.u_right, &k.depth})
        if (!std::isfinite(*x)) *x = -1;
    }
    keyframes_.push_back(map_.add_keyframe(keypoints, {}));
  }
  void add_point(choices& c) {
    const auto x = c.vector(10);
    const auto k = any_keyframe(c);
    if (traits::alive(map_, k)) points_.push_back(map_.add_point(x, k));
  }
  void observe(choices& c) {
    const auto k = any_keyframe(c);
    const auto p = any_point(c);
    if (!traits::alive(map_, k) || !traits::alive(map_, p) || traits::keypoint_count(map_, k) == 0) return;
    turbomap::observe(map_, p, k, c.below(traits::keypoint_count(map_, k)));
  }
  void edit(choices& c) {
    const auto k = any_keyframe(c);
    const auto p = any_point(c), other = any_point(c);
    const unsigned what = c.byte() % 6;
    std::vector<std::pair<keyframe, std::size_t>> scratch;
    if (what < 2 && traits::alive(map_, k)) {
      auto T = traits::pose(map_, k);
      spoil(T, c);
      map_.set_pose(k, T);
    }
    if (what == 2 && traits::alive(map_, p)) traits::set_position(map_, p, c.vector(30));
    const bool there = traits::alive(map_, p) && traits::alive(map_, other);
    if (what == 3 && there && p != other) turbomap::merge_points(map_, p, other, turbomap::merge_rule::drop, scratch);
    if (what == 4 && traits::alive(map_, p)) turbomap::erase_point(map_, p);
    if (what == 5 && traits::alive(map_, k)) turbomap::erase_keyframe(map_, k);
  }
  void lie(choices& c) {
    const auto k = any_keyframe(c);
    const std::size_t i = c.below(8);
    const auto p = any_point(c);
    switch (c.byte() % 4) {
      case 0:
        map_.slots[{k.index, i}] = c.flag() ? p : point{77, 0};
        break;
      case 1:
        map_.invented.insert({p.index, {k, c.flag() ? i : i + 100}});
        break;
      case 2:
        map_.hidden[{p.index, {k.index, i}}] = true;
        break;
      default:
        map_.tell_the_truth();
    }
  }

  std::int64_t draw_time(std::int64_t last, choices& c) const {
    static constexpr std::int64_t ends[] = {std::numeric_limits<std::int64_t>::min(),
                                            std::numeric_limits<std::int64_t>::max(), 0, -1};
    if (c.byte() % 8 == 7) return ends[c.below(4)];
    const std::int64_t more = static_cast<std::int64_t>(c.byte()) - 8, most = std::numeric_limits<std::int64_t>::max();
    return last > most - 256 || last < 8 - most ? last : last + more;
  }
  /// A sample of the IMU, or a true pose.
  void add_timed(choices& c) {
    auto& r = recorder_.get().data();
    const bool imu = c.flag();
    const auto& times = imu ? r.imu_t_ns : r.gt_t_ns;
    const std::int64_t t = draw_time(times.empty() ? 0 : times.back(), c);
    const double x = c.number(10);
    const bool sound = std::isfinite(x) && (times.empty() || t >= times.back());
    const std::string before = contents(r);
    const bool added = allowed([&] {
      if (imu)
        recorder_.get().add_imu(t, {{0.1, x, 0.3}, {0, 0, 9.81}});
      else
        recorder_.get().add_ground_truth(t, {x, 0, 0, 1, 0, 0, 0});
    });
    expect(added == sound, "samples are refused by their rules");
    expect(added || contents(r) == before, "what is refused is not recorded");
  }

  bool is_reference(const reference& ref, std::int32_t self, std::size_t count) const {
    if (ref == reference{-1, -1}) return true;
    if (ref.first < 0 || ref.first > self || ref.second < 0) return false;
    const auto& r = recorded();
    return static_cast<std::size_t>(ref.second) <
           (ref.first == self ? count : r.keypoints(static_cast<std::size_t>(ref.first)).size());
  }
  /// The rules, each by itself. Null: the keyframe stands on a threshold.
  std::optional<bool> is_sound(keyframe k, const data_type& data, std::int64_t t_ns,
                               const recent_points& recent) const {
    const auto& r = recorded();
    const auto self = static_cast<std::int32_t>(r.keyframe_count());
    const auto count = static_cast<std::size_t>(data.keypoint_count);
    bool sound = count == traits::keypoint_count(map_, k) && indices_.count(traits::id(map_, k)) == 0;
    sound = sound && (r.t_ns.empty() || t_ns >= r.t_ns.back());
    for (std::size_t i = 0; i < count; ++i) {
      const auto& p = data.keypoints[i];
      sound = sound && finite({p.x, p.y, p.angle, p.u_right, p.depth}) && p.octave < levels_;
      sound = sound && p.camera <= (pair_ ? 1 : 0) && (i == 0 || p.camera >= data.keypoints[i - 1].camera);
    }
    for (const auto& p : recent)
      sound = sound && is_reference({p.reference.keyframe, p.reference.keypoint}, self, count);
    if (!sound) return false;  // also where there is no slot to ask for
    const auto T = traits::pose(map_, k);
    const auto as_float = [](double x) { return std::abs(x) < 3.4e38; };
    const double off = std::abs(T.qx * T.qx + T.qy * T.qy + T.qz * T.qz + T.qw * T.qw - 1);
    sound = as_float(T.tx) && as_float(T.ty) && as_float(T.tz) && off < 1e-3;
    for (const auto& a : associations(k)) {
      const auto& x = traits::position(map_, a.seen);
      sound = sound && as_float(x.x) && as_float(x.y) && as_float(x.z);
      sound = sound && is_reference(a.latest, self, count) && is_reference(a.earliest, self, count);
    }
    if (sound ? off > 0.999e-3 : off < 1.001e-3 && off >= 1e-3) return {};
    return sound;
  }
  struct association {
    std::int32_t keypoint;
    point seen;
    bool is_new;
    reference latest, earliest;
  };
  /// By the definition: of all views before this keyframe's, those in the last and in the first keyframe.
  std::vector<association> associations(keyframe k) const {
    const auto self = static_cast<std::int32_t>(recorded().keyframe_count());
    std::vector<association> all;
    for (std::size_t i = 0; i < traits::keypoint_count(map_, k); ++i) {
      const point p = traits::point_at(map_, k, i);
      if (p == point{} || !traits::alive(map_, p)) continue;
      std::set<std::int32_t> own{static_cast<std::int32_t>(i)};
      std::map<std::int32_t, std::set<std::int32_t>> before;
      traits::for_each_observation(map_, p, [&](keyframe o, std::size_t at) {
        const auto known = indices_.find(traits::id(map_, o));
        if (o == k)
          own.insert(static_cast<std::int32_t>(at));
        else if (known != indices_.end())
          before[known->second].insert(static_cast<std::int32_t>(at));
      });
      const auto first_of = [](const auto& seen) { return reference{seen.first, *seen.second.begin()}; };
      const reference mine{self, *own.begin()};
      all.push_back({static_cast<std::int32_t>(i), p, before.empty(),
                     before.empty() ? mine : first_of(*before.rbegin()),
                     before.empty() ? mine : first_of(*before.begin())});
    }
    return all;
  }

  void record(keyframe k, choices& c) {
    if (!traits::alive(map_, k)) return;
    const auto given = map_.keypoints(k);
    std::vector<turbomap::keypoint> keypoints(given.begin(), given.end());
    spoil_keypoints(keypoints, c);
    std::vector<std::uint8_t> descriptors(32 * keypoints.size());
    for (auto& d : descriptors) d = static_cast<std::uint8_t>(++descriptor_);
    data_type data;
    data.keypoint_count = static_cast<int>(keypoints.size());
    data.keypoints = keypoints.data(), data.descriptors = descriptors.data();
    const auto& r = recorded();
    const std::int64_t t_ns = draw_time(r.t_ns.empty() ? 0 : r.t_ns.back(), c);
    recent_points recent;
    for (unsigned n = c.byte() % 4 == 3 ? 1 + c.byte() % 2 : 0; n > 0; --n)
      recent.push_back({{static_cast<std::int32_t>(c.below(6)) - 1, static_cast<std::int32_t>(c.below(6)) - 1},
                        static_cast<std::int32_t>(c.byte()),
                        static_cast<std::int32_t>(c.byte()),
                        2});
    const auto sound = is_sound(k, data, t_ns, recent);
    const auto expected = sound.value_or(false) ? associations(k) : std::vector<association>();
    const std::string before = contents(r);
    const auto self = static_cast<std::int32_t>(r.keyframe_count());
    std::int32_t index = -1;
    const bool added = allowed([&] { index = recorder_.add(map_, k, data, t_ns, recent); });
    if (sound) expect(added == *sound, "keyframes are refused by their rules");
    if (!added) return expect(contents(r) == before, "what is refused is not recorded");
    expect(index == self && r.keyframe_count() == static_cast<std::size_t>(self) + 1, "keyframes are numbered");
    indices_[traits::id(map_, k)] = index;
    if (sound) expect_recorded(k, data, expected);
  }
  /// Now and then one number, two keypoints that change places, or one keypoint fewer than the map has.
  static void spoil_keypoints(std::vector<turbomap::keypoint>& keypoints, choices& c) {
    const unsigned what = c.byte() % 16;
    if (what < 11 || keypoints.empty()) return;
    auto& k = keypoints[c.below(keypoints.size())];
    if (what == 11) k.x = c.single(600);
    if (what == 12) k.angle = c.single(360), k.depth = c.single(10);
    if (what == 13) k.octave = static_cast<std::uint8_t>(c.byte());
    if (what == 14) k.camera = static_cast<std::uint8_t>(c.below(3));
    if (what == 15) keypoints.pop_back();
  }
  void expect_recorded(keyframe k, const data_type& data, const std::vector<association>& expected) const {
    const auto& r = recorded();
    const std::size_t self = r.keyframe_count() - 1;
    const auto keypoints = r.gather_keypoints(self);
    expect(keypoints.size() == static_cast<std::size_t>(data.keypoint_count), "all keypoints are recorded");
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
      const auto &a = keypoints[i], &b = data.keypoints[i];
      expect(a.x == b.x && a.y == b.y && a.angle == b.angle && a.u_right == b.u_right && a.depth == b.depth &&
                 a.group == b.group && a.octave == b.octave && a.camera == b.camera,
             "keypoints are those of the keyframe");
      expect(std::equal(r.descriptors(self)[i].begin(), r.descriptors(self)[i].end(), data.descriptors + 32 * i),
             "descriptors are those of the keyframe");
    }
    const auto& T = traits::pose(map_, k);
    expect(r.T_cw[self].qw == static_cast<float>(T.qw) && r.T_cw[self].tx == static_cast<float>(T.tx) &&
               r.T_cw[self].tz == static_cast<float>(T.tz),
           "the pose is the map's");
    const auto rows = r.associations(self);
    expect(rows.size() == expected.size(), "all associations are recorded");
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const auto& e = expected[i];
      const auto &latest = r.assoc_ref[rows.begin + i], &earliest = r.assoc_ref2[rows.begin + i];
      const auto& x = traits::position(map_, e.seen);
      expect(r.assoc_kp[rows.begin + i] == e.keypoint && (r.assoc_new[rows.begin + i] == 1) == e.is_new,
             "associations are the map's");
      expect(reference(latest.keyframe, latest.keypoint) == e.latest, "the latest view is named");
      expect(reference(earliest.keyframe, earliest.keypoint) == e.earliest, "the earliest view is named");
      expect(r.assoc_pos[rows.begin + i].x == static_cast<float>(x.x), "positions are the map's");
    }
  }

  void write() {
    const auto& r = recorded();
    const auto directory = folder() / "written";
    if (r.keyframe_count() == 0) {
      expect(!reads([&] { recorder_.write(directory); }), "a recording has a keyframe");
      return;
    }
    expect(reads([&] { recorder_.write(directory); }), "what was added can be written");
    turbomap::recording back;
    expect(reads([&] { back = turbomap::read_recording(directory); }), "what was written can be read");
    expect(contents(back) == contents(r), "a recording is read back");
    turbomap::write_recording_meta(folder() / "meta.json", back.meta);
    expect(turbomap_test::file_bytes(folder() / "meta.json") == turbomap_test::file_bytes(directory / "meta.json"),
           "meta.json is read back");
  }
  const turbomap::recording& recorded() const { return recorder_.get().data(); }

  bool pair_;
  int levels_;
  mutable turbomap::map_recorder<lying_map> recorder_;  ///< what it has collected is given to be changed
  lying_map map_;
  std::vector<keyframe> keyframes_;
  std::vector<point> points_;
  std::map<std::uint64_t, std::int32_t> indices_;  ///< of what is recorded, by id
  unsigned descriptor_ = 0;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  const auto meta = draw_meta(c);
  std::optional<world> w;
  const bool made = allowed([&] { w.emplace(meta, c); });
  expect(!made || meta.sensor != "inertial", "a recorder of states is refused");
  if (made) w->run(c);
  return 0;
}
