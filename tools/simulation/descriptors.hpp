// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What 256-bit descriptors do: observations of one point are at a median Hamming distance of 38, those of different
/// points at 119 on average with a spread of about 18, as in recordings of a real extractor (there 33 to 42, and 126 +-
/// 21).

#include <bitset>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include <turbomap/io/recording_data.hpp>

#include "random.hpp"

namespace turbomap::simulation {

struct descriptor_options {
  /// Bits that say the same about the patch come in groups: with 24 independent ones, distances of different points
  /// spread by 256 (1 - 2 flip)^2 sqrt(0.249 / 24) = 18, where independent bits would give 8 and no false match ever.
  int independent_bits = 24;
  double bias = 0.158;       ///< |P(bit) - 1/2|: 256 * 2 * (1/4 - (bias (1 - 2 flip))^2) = 119
  double flip = 0.081;       ///< mean probability that an observation flips a bit: 256 * 2 * flip (1 - flip) = 38
  double flip_spread = 0.6;  ///< an observation's own probability is flip * (1 +- spread), uniform: good and bad views
  int groups = 112;          ///< visual words, the observed descriptor's nearest of as many fixed centroids ...
  int stop_groups = 12;      ///< ... of which the last so many are stop words: such a keypoint has no group
  std::uint32_t first_group = 11;  ///< id of the first word
};

inline std::uint32_t hamming(const descriptor_bytes& a, const descriptor_bytes& b) {
  std::uint64_t x[4], y[4], distance = 0;
  std::memcpy(x, a.data(), sizeof x), std::memcpy(y, b.data(), sizeof y);
  for (int i = 0; i < 4; ++i) distance += std::bitset<64>(x[i] ^ y[i]).count();
  return static_cast<std::uint32_t>(distance);
}

/// Descriptors of scene points and clutter, and the words they belong to.
class descriptor_model {
 public:
  explicit descriptor_model(const descriptor_options& options) : options_(options) {
    for (int g = 0; g < options.groups; ++g)  // fixed: a vocabulary does not depend on the run
      centroids_.push_back(patch(random_stream(0, purpose::centroid, static_cast<std::uint64_t>(g))));
  }

  /// The descriptor of a new patch, without noise.
  descriptor_bytes patch(random_stream random) const {
    std::vector<double> values(static_cast<std::size_t>(options_.independent_bits));
    for (double& v : values) v = random.uniform();
    descriptor_bytes bytes{};
    for (std::size_t bit = 0; bit < 256; ++bit) {
      const double threshold = 0.5 + (bit % values.size() % 2 == 0 ? 1 : -1) * options_.bias;
      if (values[bit % values.size()] < threshold) bytes[bit / 8] |= static_cast<std::uint8_t>(1u << (bit % 8));
    }
    return bytes;
  }

  /// The patch as one keypoint sees it: bits flipped.
  descriptor_bytes observe(descriptor_bytes patch, random_stream& random) const {
    const double flip = options_.flip * (1 + options_.flip_spread * random.uniform(-1, 1));
    const auto threshold = static_cast<std::uint64_t>(flip * 65536);
    for (std::size_t bit = 0; bit < 256; bit += 4) {
      std::uint64_t draws = random.next();
      for (std::size_t k = bit; k < bit + 4; ++k, draws >>= 16)
        if ((draws & 0xFFFF) < threshold) patch[k / 8] ^= static_cast<std::uint8_t>(1u << (k % 8));
    }
    return patch;
  }

  /// The visual word of an observed descriptor, keypoint::no_group for a stop word. Ties: the first centroid.
  std::uint32_t group(const descriptor_bytes& observed) const {
    std::uint32_t best = std::numeric_limits<std::uint32_t>::max(), word = 0;
    for (std::uint32_t g = 0; g < centroids_.size(); ++g) {
      const std::uint32_t distance = hamming(observed, centroids_[g]);
      if (distance < best) best = distance, word = g;
    }
    const bool stop = word + static_cast<std::uint32_t>(options_.stop_groups) >= centroids_.size();
    return stop ? keypoint::no_group : options_.first_group + word;
  }

 private:
  descriptor_options options_;
  std::vector<descriptor_bytes> centroids_;
};

}  // namespace turbomap::simulation
