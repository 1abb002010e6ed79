// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// One of several camera models, chosen at run time: rigs of mixed models. Plain bytes and a number, so that it works
/// in device code, where std::variant and virtual functions do not.

#include <algorithm>
#include <cstddef>
#include <new>
#include <tuple>
#include <type_traits>

#include "../config.hpp"
#include "../error.hpp"
#include "../types.hpp"
#include "camera_concept.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Index of T in the list, or its length when it is not there.
template <class T, class... List>
constexpr int index_of() {
  int i = 0;
  bool found = false;
  ((found = found || std::is_same_v<T, List>, i += found ? 0 : 1), ...);
  return i;
}

}  // namespace detail

TURBOMAP_END_NAMESPACE

namespace turbomap {

/// A camera model that holds one of `Cameras`; itself a camera model, with the same answers as the one it holds (in
/// double and strict<double> to the bit).
template <class... Cameras>
class any_camera {
  static_assert(sizeof...(Cameras) > 0 && (require_camera<Cameras>() && ...));
  template <int I>
  using model = std::tuple_element_t<static_cast<std::size_t>(I), std::tuple<Cameras...>>;
  static constexpr int count = static_cast<int>(sizeof...(Cameras));

 public:
  /// Of the parameters.
  using scalar = std::common_type_t<typename Cameras::scalar...>;

  /// Holds the first model, value-initialised.
  any_camera() : any_camera(model<0>{}) {}
  /// Holds a copy of `camera`, which must be of one of the models.
  template <class C, class = std::enable_if_t<(std::is_same_v<C, Cameras> || ...)>>
  any_camera(const C& camera) : index_(detail::index_of<C, Cameras...>()) {
    ::new (static_cast<void*>(bytes_)) C(camera);
  }

  /// Position in `Cameras` of the model that it holds.
  TURBOMAP_HD int index() const { return index_; }
  /// The model if it is a C, else null.
  template <class C>
  TURBOMAP_HD const C* get_if() const {
    return index_ == detail::index_of<C, Cameras...>() ? reinterpret_cast<const C*>(bytes_) : nullptr;
  }

  /// As the model that it holds; so are the others.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool project(const vec3<S>& point, vec2<S>& pixel) const {
    return project_as<0>(point, pixel);
  }
  /// The unit ray of a pixel.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool unproject(const vec2<S>& pixel, vec3<S>& bearing) const {
    return unproject_as<0>(pixel, bearing);
  }
  /// False also when the model that it holds has no derivative.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool jacobian(const vec3<S>& point, mat23<S>& d_pixel_d_point) const {
    return jacobian_as<0>(point, d_pixel_d_point);
  }
  /// False also when the model that it holds does not compute both at once.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool project_with_jacobian(const vec3<S>& point, vec2<S>& pixel, mat23<S>& d_pixel_d_point) const {
    return project_with_jacobian_as<0>(point, pixel, d_pixel_d_point);
  }
  /// True, and the pinhole set, where the model is one.
  TURBOMAP_HD bool as_pinhole(pinhole<double>& equivalent) const { return as_pinhole_as<0>(equivalent); }
  /// The least resolution within the bounds.
  double min_pixels_per_radian(const image_bounds& bounds) const {
    double result = 0;
    visit([&](const auto& camera) { result = turbomap::min_pixels_per_radian(camera, bounds); });
    return result;
  }
  /// Throws std::invalid_argument for what no camera can have.
  void validate() const {
    visit([](const auto& camera) { validate_camera(camera); });
  }

  /// Calls `function(model)` with the model that it holds; host only.
  template <class Function>
  void visit(Function&& function) const {
    (void)((get_if<Cameras>() != nullptr && (function(*get_if<Cameras>()), true)) || ...);
  }

 private:
  // One recursion per member, not a visit() with a lambda: extended lambdas are an option of nvcc that users may not
  // set.
  template <int I, class S, class = detail::this_target>
  TURBOMAP_HD bool project_as(const vec3<S>& point, vec2<S>& pixel) const {
    if constexpr (I < count) {
      if (index_ == I) return held<I>().project(point, pixel);
      return project_as<I + 1>(point, pixel);
    }
    return false;
  }
  template <int I, class S, class = detail::this_target>
  TURBOMAP_HD bool unproject_as(const vec2<S>& pixel, vec3<S>& bearing) const {
    if constexpr (I < count) {
      if (index_ == I) return held<I>().unproject(pixel, bearing);
      return unproject_as<I + 1>(pixel, bearing);
    }
    return false;
  }
  template <int I, class S, class = detail::this_target>
  TURBOMAP_HD bool jacobian_as(const vec3<S>& point, mat23<S>& d_pixel_d_point) const {
    if constexpr (I < count) {
      if (index_ != I) return jacobian_as<I + 1>(point, d_pixel_d_point);
      if constexpr (has_jacobian_v<model<I>>) return held<I>().jacobian(point, d_pixel_d_point);
    }
    return false;
  }
  template <int I, class S, class = detail::this_target>
  TURBOMAP_HD bool project_with_jacobian_as(const vec3<S>& point, vec2<S>& pixel, mat23<S>& d_pixel_d_point) const {
    if constexpr (I < count) {
      if (index_ != I) return project_with_jacobian_as<I + 1>(point, pixel, d_pixel_d_point);
      if constexpr (has_project_with_jacobian_v<model<I>>)
        return held<I>().project_with_jacobian(point, pixel, d_pixel_d_point);
    }
    return false;
  }
  template <int I>
  TURBOMAP_HD bool as_pinhole_as(pinhole<double>& equivalent) const {
    if constexpr (I < count) {
      if (index_ == I) return turbomap::as_pinhole(held<I>(), equivalent);
      return as_pinhole_as<I + 1>(equivalent);
    }
    return false;
  }

  template <int I>
  TURBOMAP_HD const model<I>& held() const {
    return *reinterpret_cast<const model<I>*>(bytes_);
  }

  // Equal cameras are recognised by their bytes: what the model leaves is 0, and there is no padding behind the index.
  static constexpr std::size_t alignment = std::max({alignof(int), alignof(Cameras)...});
  static constexpr std::size_t room =
      (std::max({sizeof(Cameras)...}) + sizeof(int) + alignment - 1) / alignment * alignment - sizeof(int);
  alignas(alignment) unsigned char bytes_[room] = {};
  int index_;
};

}  // namespace turbomap
