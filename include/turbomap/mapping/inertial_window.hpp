// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What an inertial adjustment takes of the user's map: the last keyframes in time, which move, the one before them and other
/// observers of their points, which hold them in place, and what the IMU measured from each to the next.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "../config.hpp"
#include "../inertial/inertial_edges.hpp"
#include "../inertial/inertial_frame.hpp"
#include "../map/inertial_traits.hpp"
#include "../map/map_traits.hpp"
#include "../map/read_ahead.hpp"
#include "../math/rotation.hpp"
#include "../plain_vector.hpp"
#include "adjustment_window.hpp"
#include "border_prior.hpp"
#include "inertial_adjustment_options.hpp"
#include "look_again.hpp"
#include "stage.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// An adjustment_window whose first frames, the *chain*, follow each other back in time from the current keyframe. The last
/// of them, the keyframe before those that move, is fixed, unless a border_prior knows of it: then it moves, too. Where the
/// map begins with them, the oldest one keeps its pose, and until there are options.fewest_edges its biases. While the
/// estimates are young (refined() of the traits), it keeps its place alone: the map may turn until gravity points where the
/// map says. Where the chain begins anew in the middle of a map (nothing came before it, or it is the current keyframe alone, as the
/// one before cannot be used), its oldest frame moves too, once other keyframes that see its points hold it in place.
template <class Map>
class inertial_window : public adjustment_window<Map> {
  using base = adjustment_window<Map>;

 public:
  /// @{
  /// Types of the map, as its traits name them.
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  /// @}

  /// Chooses the frames that follow each other, and what joins them; read() adds the rest. The caller holds the guard, here and in
  /// the next two. \param current  alive and in the store
  ///
  /// A motion that is not known, or cannot be used, or whose covariance has no inverse, is left out: the chain has a hole there.
  /// Frames that nothing inertial joins keep velocity and biases; where no fixed frame is before a hole's end, the biases of the
  /// first frame after it are held.
  /// \param known  asked for what is known of the last frame; null: nothing is, it is fixed
  /// \throws inconsistent_map  as adjustment_window, and a motion, velocity or bias that is not finite, or a motion of another
  ///         duration than the time between its keyframes, or beyond options.max_force; where the scope notes faults, these are
  ///         passed over
  template <class Policy>
  void choose(const mapping_scope<Map, Policy>& s, keyframe current, const inertial_window_options& window,
              const inertial_adjustment_options& options, border_prior* known = nullptr) {
    clear();
    follow(s, current, static_cast<std::size_t>(window.keyframes));
    if (chain_ == 0) return;
    const std::size_t border = chain_ - 1;
    if (known != nullptr && usable_[border] != 0) prior_ = known->of(this->frames_.ids()[border], states_[border]);
    if (begins_ && prior_ && prior_->first) prior_.reset();
    join(s, window, options);
    const bool first = begins_ && border > 0 && !prior_;
    if (prior_ || first) this->fixed_[border] = 0;
    if (first) {
      // Of a rotation gravity tells two parts, and heading is nobody's: nothing moves it.
      const bool told = joined_ >= static_cast<std::size_t>(options.fewest_edges), turns = told && !is_refined(s.map);
      held_[border] |= turns ? inertial_frame::hold_centre : inertial_frame::hold_pose;
      if (!told) held_[border] |= inertial_frame::hold_biases;
    }
    this->local_ = chain_ - (this->fixed_[border] != 0 ? 1 : 0);
    if (chain_ == 1) this->local_ = 1;  // its points say which keyframes hold it
    most_observers_ = static_cast<std::size_t>(options.most_observers);
  }
  /// Reads the points of the frames that move, other observers of them, and their observations: the next `most` slots or points.
  /// \return whether some are left
  /// \throws inconsistent_map  as adjustment_window::read()
  /// In all O(observations of the points of the frames that move).
  template <class Policy>
  bool read(const mapping_scope<Map, Policy>& s, std::size_t most) {
    if (this->read_slots(s.map, most, [&](const point& p) { take_point(s, p); })) return true;
    const auto next = [&](std::size_t& first, std::size_t limit, const auto& visit) {
      const std::size_t left = this->points_.size() - first, read = left < limit ? left : limit;
      for_each_ahead<point_data::entry + point_data::views>(
          s.map, read, [&](std::size_t i) { return this->points_[first + i]; },
          [&](std::size_t i, const point& p) { visit(first + i, p); });
      first += read, most -= read;
    };
    constexpr std::size_t some = 256;  // points between two looks whether there are observers enough
    while (next_observed_ < this->points_.size() && observers_ < most_observers_) {
      if (most == 0) return true;
      next(next_observed_, most < some ? most : some, [&](std::size_t, const point& p) {
        if (observers_ < most_observers_) observers_ += take_observer(s, p);
      });
    }
    if (next_landmark_ < this->points_.size()) {
      if (most == 0) return true;
      next(next_landmark_, most, [&](std::size_t l, const point&) { take_rows(s, l); });
      if (next_landmark_ < this->points_.size()) return true;
    }
    const rigid_transform<double>* T_cw = this->frames_.T_cw().begin();
    for (std::size_t f = chain_; f < this->frames_.size(); ++f) {
      states_.push_back({T_cw[f], {}, {}});
      held_.push_back(inertial_frame::visual_only);
    }
    free_oldest();
    return false;
  }
  /// Whether somebody has moved a keyframe of the window since it was read: velocities and gravity may be others too, so the
  /// window is of no use.
  template <class Policy>
  bool moved(const mapping_scope<Map, Policy>& s) {
    return this->frames_.read_poses(s.map);
  }
  /// Nothing is in the window; the memory stays.
  void clear() {
    base::clear();
    states_.clear(), held_.clear(), usable_.clear();
    edges_.clear();
    prior_.reset();
    chain_ = joined_ = 0, begins_ = oldest_is_origin_ = false;
    observers_ = next_observed_ = next_landmark_ = 0;
  }

  std::size_t chain() const { return chain_; }    ///< frames that follow each other in time, the current one first
  std::size_t joined() const { return joined_; }  ///< of them, how many have a motion from the one before
  const plain_vector<inertial_state<double>>& states() const { return states_; }  ///< by frame
  const plain_vector<std::uint32_t>& held() const { return held_; }               ///< by frame: frame_input::held
  /// What the IMU measured between frames that follow each other, and how biases may walk.
  const inertial_edges& edges() const { return edges_; }
  /// What is known of the last frame of the chain from those before it; null: nothing.
  const border_prior::knowledge* prior() const { return prior_ ? &*prior_ : nullptr; }

 private:
  using inertial = inertial_traits<Map>;
  using role = typename base::role;

  /// The current keyframe and those before it, as far as they can be used: so many that move, and one more. Where the one before
  /// cannot be used, the last is fixed as well: only the beginning of the map is free to be corrected.
  template <class Policy>
  void follow(const mapping_scope<Map, Policy>& s, keyframe current, std::size_t wanted) {
    keyframe k = current;
    while (chain_ <= wanted && !(k == keyframe{})) {
      look_again(s.map, k);  // its pose is of the same moment as its velocity
      if (!s.can_use(k)) break;
      const bool fixed = chain_ == wanted;
      if (this->add_frame(s, k, fixed ? role::fixed : role::free) != chain_)
        break;  // met before: the times run in a circle
      inertial_state<double> x{unit(this->frames_.T_cw()[chain_]), inertial::velocity(s.map, k),
                               inertial::bias(s.map, k)};
      if (!detail::is_finite(x.velocity) || !detail::is_finite(x.bias)) {
        s.faults({map_fault::bad_inertial_state, traits::id(s.map, k), 0, 0});
        x.velocity = {0, 0, 0}, x.bias = {};
        usable_.push_back(0);
      } else {
        usable_.push_back(1);
      }
      states_.push_back(x);
      ++chain_;
      if (fixed) break;
      const keyframe before = traits::previous(s.map, k);
      begins_ = base::is_origin(s.map, k) || before == keyframe{};
      if (begins_) break;
      k = before;
    }
    if (chain_ == 0) return;
    this->fixed_[chain_ - 1] = 1;
    oldest_is_origin_ = base::is_origin(s.map, this->frames_[chain_ - 1]);  // it may be gone when read() ends
  }
  /// A quaternion of a float system is not quite of length 1. Visual rows normalise it, inertial ones do not.
  static rigid_transform<double> unit(const rigid_transform<double>& T) {
    const double square = T.qx * T.qx + T.qy * T.qy + T.qz * T.qz + T.qw * T.qw;
    return std::abs(square - 1) > 1e-14 ? normalised(T) : T;
  }
  /// The edges of the chain, and what is held of its frames.
  template <class Policy>
  void join(const mapping_scope<Map, Policy>& s, const inertial_window_options& window,
            const inertial_adjustment_options& options) {
    held_.assign(chain_, inertial_frame::visual_only);
    preintegration<double> motion;
    for (std::size_t f = 0; f + 1 < chain_; ++f) {
      if (!read_motion(s, f, options, motion)) continue;
      const bool last = f + 2 == chain_, anchored = last && !begins_ && !prior_;
      // A walk alone would hold biases to those of the first frame after the hole, which do not move.
      if (!edges_.add(static_cast<std::int32_t>(f + 1), static_cast<std::int32_t>(f), motion, anchored, window, false))
        continue;
      ++joined_;
      held_[f] = 0;
      held_[f + 1] = last ? 0 : inertial_frame::hold_biases;  // until the edge before it is found
    }
    if (!prior_) return;
    if ((held_[chain_ - 1] & inertial_frame::hold_velocity) != 0)
      prior_.reset();  // no edge leads from it
    else
      held_[chain_ - 1] = prior_->held;
  }
  /// From frame f + 1 of the chain to f. False: it is not known, or cannot be used.
  template <class Policy>
  bool read_motion(const mapping_scope<Map, Policy>& s, std::size_t f, const inertial_adjustment_options& options,
                   preintegration<double>& motion) const {
    if (usable_[f] == 0 || usable_[f + 1] == 0 || !inertial::motion(s.map, this->frames_[f], motion)) return false;
    const double end = traits::time(s.map, this->frames_[f]), begin = traits::time(s.map, this->frames_[f + 1]);
    if (detail::is_usable(motion, options.max_force) && detail::lasts(motion, end - begin, options.max_time_error))
      return true;
    s.faults({map_fault::bad_motion, this->frames_.ids()[f], 0, 0});
    return false;
  }

  /// Of a chain that others hold in place the oldest frame moves, too. One of them would leave the scale of a single camera free.
  /// Once they are gone it is held again.
  void free_oldest() {
    if (chain_ == 0) return;
    const std::size_t border = chain_ - 1;
    const bool is_held = this->frames_.size() >= chain_ + 2 && !oldest_is_origin_;
    if (chain_ == 1) {
      this->fixed_[0] = is_held ? 0 : 1;
      this->local_ = is_held ? 1 : 0;
    } else if (is_held && begins_ && !prior_) {
      held_[border] &= ~inertial_frame::hold_pose;
    } else if (!is_held && prior_ && prior_->first && (held_[border] & inertial_frame::hold_pose) == 0) {
      held_[border] |= inertial_frame::hold_pose;
    }
  }
  template <class Policy>
  void take_point(const mapping_scope<Map, Policy>& s, point p) {
    std::size_t number;
    this->place_point(s, p, number);
  }
  /// The first keyframe that sees the point and is not there yet becomes a fixed frame. \return how many did
  template <class Policy>
  std::size_t take_observer(const mapping_scope<Map, Policy>& s, point p) {
    const std::size_t before = this->frames_.size();
    if (!traits::alive(s.map, p)) return 0;  // erased between two calls
    traits::for_each_observation(s.map, p, [&](keyframe k, std::size_t) {
      if (this->frames_.size() == before && this->frames_.find(s.map, k) == id_table::none && s.can_use(k))
        this->add_frame(s, k, role::fixed);
    });
    return this->frames_.size() - before;
  }
  /// The views of point l from the frames.
  template <class Policy>
  void take_rows(const mapping_scope<Map, Policy>& s, std::size_t l) {
    if (!traits::alive(s.map, this->points_[l])) return;
    traits::for_each_observation(s.map, this->points_[l], [&](keyframe k, std::size_t keypoint) {
      const std::size_t f = this->frames_.find(s.map, k);
      if (f != id_table::none) this->add_row(s, f, l, keypoint);
    });
  }

  std::size_t chain_ = 0, joined_ = 0;
  std::size_t most_observers_ = 0, observers_ = 0;     ///< fixed frames that see its points: wanted, found
  std::size_t next_observed_ = 0, next_landmark_ = 0;  ///< points whose observers, and whose rows, are read next
  bool begins_ = false;                                ///< the map, with the last of the chain
  bool oldest_is_origin_ = false;                      ///< the last of the chain, of the map
  plain_vector<std::uint8_t> usable_;                  ///< by frame of the chain: its velocity and bias are finite
  plain_vector<inertial_state<double>> states_;
  plain_vector<std::uint32_t> held_;
  inertial_edges edges_;
  std::optional<border_prior::knowledge> prior_;
};

TURBOMAP_END_NAMESPACE
