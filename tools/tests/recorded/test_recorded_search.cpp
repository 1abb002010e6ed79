// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The correspondence search and point creation on every recorded snapshot, against what the recorded peer did.

#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/io/recording.hpp>
#include "readers/recording_snapshot.hpp"

#include <thrust/execution_policy.h>

#include <array>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "matching/matching_cases.hpp"
#include "matching/tracks_cases.hpp"
#include "support/policies.hpp"
#include "support/support.hpp"

namespace {

using namespace turbomap_test;
using turbomap::candidates;

/// What is compared, over all snapshots of a recording.
struct totals {
  long pairs = 0, missing = 0, extra = 0;  // grouped search, the peer's batch pairs
  long exhaustive = 0, ordered_differs = 0, grouped_lost = 0, policies_differ = 0;
  long oracle_doubtful = 0, oracle_differs = 0;
  long tracks = 0, contradictions = 0, tracks_differ = 0;
  long created = 0, outcome_differs = 0, position_differs = 0;
};

template <class Camera>
class replayed {
 public:
  using posed = turbomap::posed_keyframe<orb, Camera>;

  replayed(const turbomap::recording& r, const test_rig<Camera>& rig) : recording_(r), rig_(rig) {}

  totals check(const std::filesystem::path& directory) {
    for (const auto iteration : recording_.meta.snapshots) {
      CAPTURE(iteration);
      const auto s = turbomap::read_snapshot(recording_, directory, iteration);
      check_search(s);
      for (std::size_t i = 0; i < s.search.neighbours.size(); ++i) check_creation(s, i);
    }
    return totals_;
  }

 private:
  posed keyframe(const turbomap::recording_snapshot& s, std::int32_t index, turbomap::span<const std::uint8_t> mask) {
    scene_frame<orb, Camera>& f = frames_[index];
    if (f.block.size() == 0) {
      f.keypoints = recording_.gather_keypoints(static_cast<std::size_t>(index));
      const auto d = recording_.descriptors(static_cast<std::size_t>(index));
      const auto* bytes = d.data()->data();
      f.descriptors.assign(bytes, bytes + d.size() * orb::elements);
      f.cameras = rig_.cameras;
      f.bounds = rig_.bounds;
      f.pack(scratch_, recording_.meta.pyramid());
    }
    posed p = f.posed();
    p.has_point = mask;
    const auto at = std::lower_bound(s.kf_alive.begin(), s.kf_alive.end(), index) - s.kf_alive.begin();
    p.T_cw = turbomap::cast<double>(s.kf_T_cw[static_cast<std::size_t>(at)]);
    return p;
  }

  turbomap::search_options options(candidates set) const {
    turbomap::search_options o;
    o.candidate_set = set;
    o.ties = turbomap::tie_rule::highest_index;
    o.scales = recording_.meta.pyramid();
    return o;
  }
  template <class Policy>
  plan_of<orb, Camera> search(const Policy& policy, const posed& query, const std::vector<posed>& neighbours,
                              candidates set) const {
    turbomap::context<Policy> ctx(policy);
    return turbomap::search_correspondences(ctx, query, turbomap::span<const posed>(neighbours), options(set))
        .plan(ctx);
  }

  void check_search(const turbomap::recording_snapshot& s) {
    std::vector<posed> neighbours;
    std::set<std::array<int, 3>> expected;
    for (std::size_t i = 0; i < s.search.neighbours.size(); ++i) {
      if (s.search.skipped[i] != 0) continue;
      for (const auto& p : s.batch_pairs(i)) expected.insert({static_cast<int>(neighbours.size()), p[0], p[1]});
      neighbours.push_back(keyframe(s, s.search.neighbours[i], s.mask2(i)));
    }
    if (neighbours.empty()) return;
    const posed query = keyframe(s, s.keyframe, s.mask1(0));

    const auto grouped = search(sequential{}, query, neighbours, candidates::grouped);
    totals_.pairs += static_cast<long>(expected.size());
    for (const auto& m : grouped) totals_.extra += expected.erase({m.neighbour, m.query, m.candidate}) == 0 ? 1 : 0;
    totals_.missing += static_cast<long>(expected.size());

    const auto all = search(sequential{}, query, neighbours, candidates::exhaustive);
    totals_.exhaustive += static_cast<long>(all.size());
    totals_.ordered_differs += same(search(sequential{}, query, neighbours, candidates::epipolar_ordered), all) ? 0 : 1;
    totals_.policies_differ +=
        same(search(turbomap_test::parallel{}, query, neighbours, candidates::epipolar_ordered), all) ? 0 : 1;
    totals_.policies_differ +=
        same(search(turbomap_test::parallel{}, query, neighbours, candidates::grouped), grouped) ? 0 : 1;
    std::map<std::array<int, 2>, int> distance;
    for (const auto& m : all) distance[{m.neighbour, m.query}] = m.distance;
    for (const auto& m : grouped) {
      const auto found = distance.find({m.neighbour, m.query});
      totals_.grouped_lost += found == distance.end() || found->second > m.distance ? 1 : 0;
    }
    check_tracks(query, neighbours);
    for (const auto set : {candidates::grouped, candidates::exhaustive}) {
      std::vector<doubtful_result> doubtful;
      const auto oracle =
          search_oracle<orb, Camera>(query, turbomap::span<const posed>(neighbours), options(set), &doubtful);
      totals_.oracle_doubtful += static_cast<long>(doubtful.size());
      totals_.oracle_differs += count_differences(oracle, set == candidates::grouped ? grouped : all, doubtful,
                                                  [](auto& a, auto& b) { return same(a, b); });
    }
  }

  /// All matches, those across the rig too, joined as the oracle joins them.
  void check_tracks(const posed& query, const std::vector<posed>& neighbours) {
    turbomap::context<sequential> ctx{};
    auto across = options(candidates::epipolar_ordered);
    across.across_rig = true;
    const auto found = turbomap::search_correspondences(ctx, query, turbomap::span<const posed>(neighbours), across);
    turbomap::match_tracks<orb, Camera, sequential> joined(ctx);
    turbomap::join_tracks(ctx, found, joined);
    const auto camera_of = [&](int keyframe, int keypoint) {
      return (keyframe == 0 ? query : neighbours[static_cast<std::size_t>(keyframe) - 1]).view.camera_of(keypoint);
    };
    const auto expected = tracks_oracle(found.plan(ctx), camera_of, found.view().own_neighbour);
    totals_.tracks += static_cast<long>(expected.tracks.size());
    for (const auto o : expected.outcomes) totals_.contradictions += o == turbomap::match_outcome::joined ? 0 : 1;
    totals_.tracks_differ += same_tracks(expected, joined.tracks()) ? 0 : 1;
  }

  /// The peer's own pairs (one neighbour after the other, masks changing) are put in place of the search's.
  void check_creation(const turbomap::recording_snapshot& s, std::size_t i) {
    const auto pairs = s.pairs(i);
    if (pairs.empty()) return;
    const std::vector<posed> neighbours{keyframe(s, s.search.neighbours[i], {})};
    turbomap::context<sequential> ctx{};
    auto none = options(candidates::grouped);
    none.max_distance = 0;
    const auto found = turbomap::search_correspondences(ctx, keyframe(s, s.keyframe, {}),
                                                        turbomap::span<const posed>(neighbours), none);
    const auto& view = found.view();
    std::fill(view.match, view.match + view.slot_count, turbomap::no_match);
    std::map<int, std::size_t> row;
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      view.match[pairs[k][0]] = pairs[k][1];  // every keypoint is a slot
      row[pairs[k][0]] = static_cast<std::size_t>(s.search.pairs_off[i]) + k;
    }
    turbomap::creation_options creation;
    creation.scales = recording_.meta.pyramid();
    if (recording_.meta.sensor == "inertial") creation.max_parallax_cosine = 0.9996;
    turbomap::point_creation<sequential> points(ctx);
    turbomap::create_points(ctx, found, creation, points);
    for (const auto& p : points.plan(ctx, found)) {
      const std::size_t r = row.at(p.query);
      ++totals_.created;
      if (static_cast<int>(p.outcome) != s.creation.code[r] || static_cast<int>(p.method) != s.creation.method[r])
        ++totals_.outcome_differs;
      if (p.outcome != turbomap::creation_outcome::accepted) continue;
      const auto peer = turbomap::cast<double>(s.creation.position[r]);
      totals_.position_differs += turbomap::norm(p.position - peer) < 1e-3 ? 0 : 1;
    }
  }

  const turbomap::recording& recording_;
  test_rig<Camera> rig_;
  std::map<std::int32_t, scene_frame<orb, Camera>> frames_;
  turbomap::keyframe_packing_scratch scratch_;
  totals totals_;
};

totals replay(const std::filesystem::path& directory) {
  const auto r = turbomap::read_recording(directory);
  const auto &a = r.meta.camera1, &b = r.meta.camera2;
  const auto f = [](double x) { return static_cast<float>(x); };
  if (!r.meta.is_fisheye()) {
    const pinhole_camera camera{f(a[0]), f(a[1]), f(a[2]), f(a[3])};
    return replayed<pinhole_camera>(r, {{{camera, {}, r.meta.bf, {}}}, r.meta.bounds}).check(directory);
  }
  const auto camera = [&f](const std::vector<double>& p) {
    return fisheye_camera{f(p[0]), f(p[1]), f(p[2]), f(p[3]), f(p[4]), f(p[5]), f(p[6]), f(p[7])};
  };
  const auto T_rl = turbomap::cast<double>(r.meta.T_rl);
  return replayed<fisheye_camera>(r, {{{camera(a), {}, 0, {}}, {camera(b), T_rl, 0, {}}}, r.meta.bounds})
      .check(directory);
}

TEST_CASE("recorded searches and points are reproduced exactly") {
  for (const char* name : {"euroc_v102_stereo", "euroc_v102_inertial", "tum_room1_stereo", "tum_room1_inertial"}) {
    const auto directory = turbomap_test::data(std::string("recordings/") + name);
    if (!directory) continue;
    const totals t = replay(*directory);
    CAPTURE(std::string(name));
    MESSAGE(std::string(name) << ": " << t.pairs << " grouped pairs, " << t.exhaustive << " exhaustive, " << t.tracks
                              << " tracks, " << t.contradictions << " contradictions, " << t.created << " created, "
                              << t.oracle_doubtful << " doubtful");
    CHECK(t.pairs > 100);
    CHECK(t.missing == 0);
    CHECK(t.extra == 0);
    CHECK(t.exhaustive > t.pairs);
    CHECK(t.ordered_differs == 0);
    CHECK(t.policies_differ == 0);
    CHECK(t.grouped_lost == 0);
    CHECK(t.oracle_differs == 0);
    CHECK(t.oracle_doubtful * 100 <= t.exhaustive);
    CHECK(t.tracks > 100);
    CHECK(t.contradictions > 10);
    CHECK(t.tracks_differ == 0);
    CHECK(t.created > 100);
    CHECK(t.outcome_differs == 0);
    CHECK(t.position_differs == 0);
  }
}

}  // namespace
