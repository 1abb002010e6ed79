// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Local mapping inside a system with its own classes (object_graph.hpp): tracking runs in a second thread, reads the
/// map under its own locks while local mapping works on it, and hands over keyframes. The images are simulated, and
/// their poses known.

#include <thrust/execution_policy.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <deque>
#include <exception>
#include <map>
#include <mutex>
#include <thread>
#include <turbomap/local_mapper.hpp>
#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/validate.hpp>
#include <utility>
#include <vector>

#include "object_graph.hpp"
#include "wall_scene.hpp"

namespace {

constexpr int keyframes_in_all = 24;
constexpr std::size_t local_keyframes = 5;

/// What tracking hands over, and the points that it made.
struct Handover {
  my::KeyFrame* keyframe;
  std::vector<my::MapPoint*> created;
};

/// From tracking to local mapping.
class Queue {
 public:
  std::size_t size() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return waiting_.size();
  }
  void push(Handover h) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      waiting_.push_back(std::move(h));
    }
    changed_.notify_one();
  }
  void close() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      closed_ = true;
    }
    changed_.notify_one();
  }
  /// False when there will be no more.
  bool pop(Handover& h) {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return closed_ || !waiting_.empty(); });
    if (waiting_.empty()) return false;
    h = std::move(waiting_.front());
    waiting_.pop_front();
    return true;
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Handover> waiting_;
  bool closed_ = false;
};

/// Tracking: finds the points of the last keyframes in the current image, counts which it finds, and makes a keyframe of
/// every image that is 0.3 m further on.
class Tracking {
 public:
  Tracking(my::Map& map, Queue& queue) : map_(map), queue_(queue) {}

  void run() {
    for (int n = 0; n < keyframes_in_all; ++n) {
      // Images between two keyframes: at least two, and more while local mapping is behind.
      for (int between = 0; n > 0 && (between < 2 || queue_.size() > 0); ++between)
        track(scene_.look_from(0.3 * n - 0.2 + 0.1 * (between % 2), 0.1 * std::sin(n)));
      const example::wall_view view = scene_.look_from(0.3 * n, 0.1 * std::sin(n));
      insert_keyframe(view, track(view));
    }
    queue_.close();
  }
  std::size_t frames() const { return frames_; }
  std::size_t found() const { return found_; }
  std::size_t wrong() const { return wrong_; }

 private:
  /// The point that each keypoint shows, or null. Takes the locks of objects, one at a time, never the map's.
  std::vector<my::MapPoint*> track(const example::wall_view& view) {
    std::vector<my::MapPoint*> seen(view.keypoints.size(), nullptr);
    if (last_.empty()) return seen;
    ++frames_;
    std::map<my::MapPoint*, int> candidates;  // with the landmark of the keypoint that names them
    for (const my::KeyFrame* k : last_) {
      const std::vector<my::MapPoint*> points = k->points_now();
      for (std::size_t i = 0; i < points.size(); ++i)
        if (points[i] != nullptr) candidates.emplace(points[i], k->truth[i]);
    }
    for (const auto& [point, landmark] : candidates) {
      const std::lock_guard<std::mutex> lock(point->mutex);
      if (point->bad || point->max_distance == 0) continue;  // merged or dropped since, or brand-new
      const turbomap::vec3<double> in_camera{point->position[0] + view.T_cw.tx, point->position[1] + view.T_cw.ty,
                                             point->position[2] + view.T_cw.tz};
      turbomap::vec2<double> pixel;
      if (!my::camera.project(in_camera, pixel) || pixel.x < 0 || pixel.x >= 640 || pixel.y < 0 || pixel.y >= 480)
        continue;
      ++point->visible;
      const std::size_t i = nearest(view, pixel, point->descriptor);
      if (i == view.keypoints.size()) continue;
      ++point->found;
      ++found_;
      wrong_ += view.landmark[i] != landmark ? 1 : 0;
      if ((frames_ + i) % 4 != 0) seen[i] = point;  // no tracker gets hold of all: local mapping finds them again
    }
    return seen;
  }
  static std::size_t nearest(const example::wall_view& view, const turbomap::vec2<double>& pixel,
                             const my::Descriptor& descriptor) {
    std::size_t best = view.keypoints.size();
    int least = 50;
    for (std::size_t i = 0; i < view.keypoints.size(); ++i) {
      if (std::fabs(view.keypoints[i].x - pixel.x) > 15 || std::fabs(view.keypoints[i].y - pixel.y) > 15) continue;
      const int d = example::orb::distance(descriptor.data(), view.descriptors.data() + 32 * i);
      if (d < least) least = d, best = i;
    }
    return best;
  }

  /// A point by stereo, as its only view shows it: local mapping makes more of it later. Under the map's lock.
  my::MapPoint* make_point(const example::wall_view& view, std::size_t i, my::KeyFrame& k) {
    using traits = turbomap::map_traits<my::Map>;
    const auto x = example::back_project(view, i);
    const turbomap::vec3<double> ray = x - turbomap::camera_centre(turbomap::to_isometry<double>(view.T_cw));
    const double distance = turbomap::norm(ray), farthest = distance * std::pow(1.2, k.features[i].level);
    my::MapPoint* const p = traits::add_point(map_, x, &k);
    traits::set_appearance(map_, p, turbomap::cast<float>((1 / distance) * ray),
                           static_cast<float>(farthest / std::pow(1.2, 7)), static_cast<float>(farthest),
                           k.features[i].descriptor.data());
    turbomap::observe(map_, p, &k, i);
    return p;
  }

  /// A keyframe enters the map, under the map's lock: a few assignments per point.
  void insert_keyframe(const example::wall_view& view, const std::vector<my::MapPoint*>& seen) {
    std::vector<my::Feature> features;
    for (std::size_t i = 0; i < view.keypoints.size(); ++i) {
      const turbomap::keypoint& k = view.keypoints[i];
      features.push_back({k.x, k.y, k.u_right, k.depth, k.octave, {}});
      std::copy_n(view.descriptors.begin() + static_cast<std::ptrdiff_t>(32 * i), 32,
                  features.back().descriptor.begin());
    }
    Handover handover{};
    {
      const std::lock_guard<std::mutex> map_lock(map_.mutex);
      my::KeyFrame& k = map_.keyframes.emplace_back();
      k.id = map_.keyframes.size() - 1;
      turbomap::map_traits<my::Map>::set_pose(map_, &k, view.T_cw);
      k.features = std::move(features);
      k.truth = view.landmark;
      k.points.assign(k.features.size(), nullptr);
      handover.keyframe = &k;
      for (std::size_t i = 0; i < k.features.size(); ++i) {
        if (last_.empty()) {  // the first keyframe makes points by stereo
          handover.created.push_back(make_point(view, i, k));
        } else if (seen[i] != nullptr) {
          // It may have been merged since it was tracked: observe what it became. Or dropped.
          if (my::MapPoint* p = turbomap::resolve(map_, seen[i])) turbomap::observe(map_, p, &k, i);
        }
      }
    }
    last_.push_back(handover.keyframe);
    if (last_.size() > local_keyframes) last_.pop_front();
    queue_.push(std::move(handover));
  }

  my::Map& map_;
  Queue& queue_;
  example::wall_scene scene_;
  std::deque<my::KeyFrame*> last_;
  std::size_t frames_ = 0, found_ = 0, wrong_ = 0;
};

/// Local mapping, on the calling thread, until the queue is closed. False when the map is not what it should be.
bool map_until_closed(my::Map& map, Queue& queue) {
  turbomap::context ctx{thrust::host};
  turbomap::keyframe_store<turbomap::binary_descriptor<256>, turbomap::pinhole<float>> store;
  auto options = turbomap::local_mapper_options::stereo(my::baseline, example::close_depth);
  turbomap::local_mapper_hooks<my::Map> hooks;
  std::size_t erasing = 0;
  hooks.erasing = [&](my::KeyFrame*) { ++erasing; };
  // A real system also has hooks.keyframes_wait = [&] { return queue.size() > 0; }, and tracking that never waits. Here
  // every keyframe goes through every stage, so that the result can be judged.
  turbomap::local_mapper mapper(ctx, map, store, options, hooks);

  std::size_t created = 0, dropped = 0, culled = 0;
  turbomap::fusion_summary fused;
  turbomap::guard_times held;
  for (Handover h{}; queue.pop(h);) {
    {
      const std::scoped_lock locks(map.mutex, h.keyframe->mutex);
      h.keyframe->waiting = false;
    }
    mapper.insert(h.keyframe, *h.keyframe);
    mapper.watch(h.created);
    const turbomap::mapping_report& report = mapper.process(h.keyframe);
    created += report.points_created, dropped += report.points_culled, culled += report.keyframes_culled.size();
    fused += report.fused;
    for (const turbomap::guard_times& t : report.held.values) {
      held.count += t.count, held.total_ms += t.total_ms;
      held.longest_ms = std::max(held.longest_ms, t.longest_ms);
    }
  }
  std::printf("%zu points created, %zu dropped, %zu duplicates merged, %zu observations added, %zu keyframes culled\n",
              created, dropped, fused.merged, fused.observations_added, culled);
  std::printf("the map's lock was held %zu times, %.3f ms at most\n", held.count, held.longest_ms);
  return created > 0 && fused.merged > 0 && fused.observations_added > 0 && culled > 0 && culled == erasing;
}

/// Every point must show one landmark, and lie where that is.
bool judge(my::Map& map) {
  const auto guard = turbomap::map_guard(map);
  const example::wall_scene scene;
  std::size_t points = 0, mixed = 0, far = 0;
  turbomap::map_traits<my::Map>::for_each_point(map, [&](my::MapPoint* p) {
    ++points;
    if (p->observations.empty()) return;
    const auto landmark_of = [](const auto& view) { return view.first->truth[view.second]; };
    const int landmark = landmark_of(p->observations.front());
    for (const auto& view : p->observations)
      if (landmark_of(view) != landmark) {
        ++mixed;
        break;
      }
    const auto& x = scene.landmark(landmark);
    far += std::hypot(p->position[0] - x.x, p->position[1] - x.y, p->position[2] - x.z) <= 0.5 ? 0 : 1;
  });
  const auto faults = turbomap::validate(map);
  for (const turbomap::map_violation& v : faults) std::printf("%s\n", turbomap::to_string(v).c_str());
  std::printf("%zu points left, %zu of more than one landmark, %zu farther than 0.5 m from theirs, %zu faults\n",
              points, mixed, far, faults.size());
  return faults.empty() && points > 400 && mixed <= points / 100 && far <= points / 25;
}

}  // namespace

int main() {
  my::Map map;
  Queue queue;
  Tracking tracking(map, queue);
  std::thread tracker([&] { tracking.run(); });
  bool good = false;
  try {
    good = map_until_closed(map, queue);
  } catch (const std::exception& error) {
    std::printf("%s\n", error.what());
    for (Handover h{}; queue.pop(h);) {
    }  // let tracking come to its end
  }
  tracker.join();
  good = judge(map) && good;
  std::printf("tracking: %zu images meanwhile, %zu points found in them, %zu wrongly\n", tracking.frames(),
              tracking.found(), tracking.wrong());
  return good && tracking.wrong() <= tracking.found() / 100 ? 0 : 1;
}
