// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What all observations together tell about the frames, on the host: for covariances. Landmarks are eliminated by an
/// orthogonal transformation of the derivatives themselves (landmark_triangle.hpp), and products are summed in extended
/// precision (profile_cholesky.hpp), so that what nothing determines stays apart from what is determined weakly: the Schur
/// complement would square the condition first.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../plain_vector.hpp"
#include "bin_lister.hpp"
#include "landmark_triangle.hpp"
#include "profile_cholesky.hpp"
#include "residual_rows.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Sums the information of the free frames. Keep one and use it again: it owns the memory that it works in.
template <int D>
class information_sum {
 public:
  /// \param held  [free frame] masks of unknowns that are known; empty: none
  /// \param sum   gets the matrix
  TURBOMAP_ONE_BODY void build(const residual_rows<D>& rows, int frames, int landmarks,
                               const plain_vector<std::uint32_t>& held, profile_cholesky& sum) {
    rows_ = &rows, held_ = &held, sum_ = &sum;
    list_by_landmark_(rows.landmark, landmarks, begin_, list_);
    make_room(frames, landmarks);
    for (std::int32_t l = 0; l < landmarks; ++l) add_landmark(begin_[at(l)], begin_[at(l) + 1]);
    for (std::size_t r = 0; r < rows.landmark.size(); ++r)
      if (rows.landmark[r] < 0) add_alone(static_cast<std::int32_t>(r));
  }

 private:
  using wide = profile_cholesky::wide;
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  /// Which columns each row reaches back to.
  void make_room(int frames, int landmarks) {
    reach_.resize(at(frames));
    for (int f = 0; f < frames; ++f) reach_[at(f)] = f;
    const auto reach = [this](int f, int g) {
      if (f >= 0 && g >= 0 && g < reach_[at(f)]) reach_[at(f)] = g;
    };
    for (std::size_t r = 0; r < rows_->first.size(); ++r)
      reach(rows_->first[r], rows_->second[r]), reach(rows_->second[r], rows_->first[r]);
    for (std::int32_t l = 0; l < landmarks; ++l) {
      int least = frames;
      for (std::int32_t k = begin_[at(l)]; k < begin_[at(l) + 1]; ++k) {
        const int f = rows_->first[at(list_[at(k)])];
        least = f >= 0 && f < least ? f : least;
      }
      for (std::int32_t k = begin_[at(l)]; k < begin_[at(l) + 1]; ++k) reach(rows_->first[at(list_[at(k)])], least);
    }
    first_.resize(at(frames * D));
    for (int i = 0; i < frames * D; ++i) first_[at(i)] = reach_[at(i / D)] * D;
    sum_->reset(first_);
    for (int i = 0; i < frames * D; ++i)
      if (is_held(i)) sum_->row(i)[i] = 1;
  }
  bool is_held(int i) const { return !held_->empty() && ((*held_)[at(i / D)] >> (i % D) & 1U) != 0; }

  /// Adds the square of one row over some unknowns.
  void add_square(const double* d, const plain_vector<std::int32_t>& frames) {
    const int m = static_cast<int>(frames.size()) * D;
    for (int i = 0; i < m; ++i) {
      if (d[i] == 0) continue;
      const int r = frames[at(i / D)] * D + i % D;
      if (is_held(r)) continue;
      wide* to = sum_->row(r);
      for (int j = 0; j < m; ++j) {
        const int c = frames[at(j / D)] * D + j % D;
        if (c <= r && !is_held(c)) to[c] += static_cast<wide>(d[i]) * static_cast<wide>(d[j]);
      }
    }
  }
  void add_alone(std::int32_t r) {
    local_.clear(), line_.clear();
    for (const bool second : {false, true}) {
      const int f = second ? rows_->second[at(r)] : rows_->first[at(r)];
      if (f < 0) continue;
      local_.push_back(f);
      const double* d = (second ? rows_->d_second : rows_->d_first).data() + at(r) * D;
      for (int i = 0; i < D; ++i) line_.push_back(d[i]);
    }
    add_square(line_.data(), local_);
  }

  /// Rows of one landmark.
  void add_landmark(std::int32_t begin, std::int32_t end) {
    const int m = end - begin;
    local_.clear();
    for (std::int32_t k = begin; k < end; ++k) {
      const std::int32_t f = rows_->first[at(list_[at(k)])];
      bool known = f < 0;
      for (const auto g : local_) known = known || g == f;
      if (!known) local_.push_back(f);
    }
    if (local_.empty()) return;
    const int columns = 3 + static_cast<int>(local_.size()) * D;
    of_landmark_.reset(m, columns);
    for (int i = 0; i < m; ++i) {
      const std::size_t r = at(list_[at(begin + i)]);
      double* to = of_landmark_.row(i);
      for (int k = 0; k < 3; ++k) to[k] = rows_->d_landmark[3 * r + at(k)];
      for (std::size_t f = 0; f < local_.size(); ++f)
        if (local_[f] == rows_->first[r])
          for (std::size_t k = 0; k < D; ++k) to[3 + f * D + k] = rows_->d_first[r * D + k];
    }
    for (int i = of_landmark_.triangulate(); i < m; ++i) add_square(of_landmark_.row(i) + 3, local_);
  }

  const residual_rows<D>* rows_ = nullptr;
  const plain_vector<std::uint32_t>* held_ = nullptr;
  profile_cholesky* sum_ = nullptr;
  bin_lister list_by_landmark_;
  plain_vector<std::int32_t> begin_, list_, local_, reach_, first_;
  plain_vector<double> line_;
  landmark_triangle of_landmark_;
};

TURBOMAP_END_NAMESPACE
