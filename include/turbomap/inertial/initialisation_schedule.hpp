// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// When the IMU is to be initialised and the result refined: more motion makes it better, so it is done again some seconds later.

#include <cstdint>

#include "../error.hpp"
#include "imu_samples.hpp"

namespace turbomap {

/// What to do now.
enum class initialisation_step : unsigned char {
  none,
  initialise,   ///< initialise_inertial(), then a visual-inertial adjustment of all keyframes
  refine,       ///< the same again, from the metric map
  refine_scale  ///< initialise_inertial() alone, for scale and gravity
};

/// Times after the first initialisation, s [ORB-SLAM3; Campos et al. 2020].
struct initialisation_times {
  double first_refinement = 5;    ///< from the metric map
  double second_refinement = 15;  ///< from the metric map
  double scale_every = 10;   ///< one camera: so often the scale is estimated again, from the second refinement on ...
  double scale_until = 100;  ///< ... so long
};

/// Says what is due at a keyframe. A plain value: copy it to save it.
class initialisation_schedule {
 public:
  /// \param monocular  one camera: the scale is estimated again later
  /// \throws std::invalid_argument  times that do not rise
  explicit initialisation_schedule(bool monocular = false, const initialisation_times& times = {})
      : monocular_(monocular), times_(times) {
    require(times.first_refinement > 0, "times.first_refinement", times.first_refinement, "must be positive");
    require(times.second_refinement > times.first_refinement, "times.second_refinement", times.second_refinement,
            "must be after the first one");
    require(times.scale_every > 0, "times.scale_every", times.scale_every, "must be positive");
  }

  /// Whether the first step succeeded.
  bool initialised() const { return initialised_; }
  /// \param t_ns  time of the keyframe
  initialisation_step due(std::int64_t t_ns) const {
    if (!initialised_) return initialisation_step::initialise;
    const double since = plain_detail::seconds_between(first_ns_, t_ns);
    if (since >= next(refinements_) && refinements_ < 2) return initialisation_step::refine;
    const bool scale = monocular_ && refinements_ == 2 && since <= times_.scale_until;
    return scale && plain_detail::seconds_between(last_ns_, t_ns) >= times_.scale_every
               ? initialisation_step::refine_scale
               : initialisation_step::none;
  }
  /// A step that was due at this time succeeded. One that failed stays due: try it again at the next keyframe.
  void done(initialisation_step step, std::int64_t t_ns) {
    if (step == initialisation_step::initialise) initialised_ = true, first_ns_ = t_ns, refinements_ = 0;
    if (step == initialisation_step::refine) ++refinements_;
    last_ns_ = t_ns;
  }
  /// The map began anew, or tracking's IMU did.
  void restart() { initialised_ = false, refinements_ = 0; }

 private:
  double next(int refinements) const { return refinements == 0 ? times_.first_refinement : times_.second_refinement; }
  bool monocular_, initialised_ = false;
  int refinements_ = 0;
  std::int64_t first_ns_ = 0, last_ns_ = 0;
  initialisation_times times_;
};

}  // namespace turbomap
