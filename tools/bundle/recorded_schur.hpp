// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A recorded linear system in the form that the library computes in. Keyframes of the system are one block of 6 (pose)
/// and three of 3, the blocks of 3 after all poses: they become frames of 15 unknowns.

#include <algorithm>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include <turbomap/adjustment/dense_cholesky.hpp>
#include <turbomap/adjustment/eliminate_landmarks.hpp>
#include <turbomap/adjustment/reduced_system.hpp>
#include <turbomap/adjustment/resident_structure.hpp>
#include <turbomap/adjustment/structure_builder.hpp>
#include <turbomap/adjustment/substitute_landmarks.hpp>
#include <turbomap/adjustment/uploaded.hpp>
#include <turbomap/context.hpp>
#include "readers/schur_system.hpp"

namespace turbomap_bundle {

/// The recorded system in the form that the library computes in.
template <class Policy>
class recorded_schur {
 public:
  static constexpr int V = 6, D = 15;
  using memory = turbomap::memory_of_t<Policy>;

  recorded_schur(turbomap::context<Policy>& ctx, const turbomap::schur_system& s)
      : ctx_(ctx), frames_(frames_of(s)), landmarks_(static_cast<int>(s.hll.row_offset.size()) - 1) {
    place_unknowns();
    gather(s);
    send();
  }

  int size() const { return frames_ * D; }

  /// Eliminates the landmarks and forms the reduced system in the order of the recording; S row-major, symmetric.
  void reduce(double lambda, std::vector<double>& S, std::vector<double>& rhs) {
    const int n = size(), padded = turbomap::dense_cholesky::padded(n);
    turbomap::array<double, memory> matrix(ctx_.resource()), right(ctx_.resource());
    matrix.resize_discard(static_cast<std::size_t>(padded) * static_cast<std::size_t>(padded));
    right.resize_discard(static_cast<std::size_t>(padded));
    turbomap::fill_bytes(ctx_.policy(), matrix.data(), 0, matrix.size() * sizeof(double));
    turbomap::launch_eliminate_landmarks<V>(ctx_.policy(), view_, {lambda});
    turbomap::launch_reduce_blocks<V, D>(ctx_.policy(), view_, {matrix.data(), right.data(), padded, true}, {lambda});
    std::vector<double> full(matrix.size()), b(at(n));
    turbomap::copy_out(ctx_.policy(), full.data(), matrix.data(), full.size() * sizeof(double));
    turbomap::copy_out(ctx_.policy(), b.data(), right.data(), b.size() * sizeof(double));
    ctx_.synchronize();
    S.assign(at(n) * at(n), 0), rhs.resize(at(n));
    for (int i = 0; i < n; ++i) {
      rhs[at(i)] = b[at(ours_[at(i)])];
      for (int j = i; j < n; ++j) {
        const int r = std::min(ours_[at(i)], ours_[at(j)]), c = std::max(ours_[at(i)], ours_[at(j)]);
        S[at(i) * at(n) + at(j)] = S[at(j) * at(n) + at(i)] = full[at(r) * at(padded) + at(c)];
      }
    }
  }

  /// Steps of the landmarks that belong to steps of the frames; after reduce().
  std::vector<double> substitute(const std::vector<double>& xp) {
    std::vector<double> step(xp.size());
    for (std::size_t i = 0; i < xp.size(); ++i) step[at(ours_[i])] = xp[i];
    const std::vector<double> zeros(at(landmarks_) * turbomap::landmark_stride, 0.0);
    turbomap::resident_copy<double, memory> x(ctx_.resource()), zero(ctx_.resource());
    x.send(ctx_.policy(), step.data(), step.size()), zero.send(ctx_.policy(), zeros.data(), zeros.size());
    turbomap::array<double, memory> to(ctx_.resource()), gain(ctx_.resource());
    to.resize_discard(zeros.size());
    gain.resize_discard(at(turbomap::landmark_gain_count(landmarks_)));
    turbomap::launch_substitute_landmarks<V, D>(ctx_.policy(), view_, x.data(), {0}, zero.data(), to.data(),
                                                gain.data());
    std::vector<double> moved(to.size()), xl;
    turbomap::copy_out(ctx_.policy(), moved.data(), to.data(), moved.size() * sizeof(double));
    ctx_.synchronize();
    for (std::size_t l = 0; l < at(landmarks_); ++l)
      for (std::size_t k = 0; k < 3; ++k) xl.push_back(moved[l * turbomap::landmark_stride + k]);
    return xl;
  }

 private:
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  static int frames_of(const turbomap::schur_system& s) {
    const auto& offset = s.hpp.row_offset;
    const std::size_t blocks = offset.size() - 1, frames = blocks / 4;
    bool fits = blocks % 4 == 0 && blocks > 0;
    for (std::size_t b = 0; fits && b < blocks; ++b) fits = offset[b + 1] - offset[b] == (b < frames ? 6 : 3);
    for (std::size_t l = 0; fits && l + 1 < s.hll.row_offset.size(); ++l)
      fits = s.hll.row_offset[l + 1] - s.hll.row_offset[l] == 3;
    for (std::size_t k = 0; fits && k < s.hpl.block_count(); ++k) fits = at(s.hpl.row[k]) < frames;
    for (std::size_t k = 0; fits && k < s.hll.block_count(); ++k) fits = s.hll.row[k] == s.hll.column[k];
    if (!fits) throw turbomap::bad_file("turbomap: hpp.txt: the blocks are not one of 6 and three of 3 per keyframe");
    return static_cast<int>(frames);
  }

  /// Block b of 3 becomes the part 6 + 3 (b % 3) of frame b / 3.
  void place_unknowns() {
    ours_.resize(at(size()));
    for (int i = 0; i < size(); ++i) {
      const int rest = i - 6 * frames_;
      ours_[at(i)] = rest < 0 ? i / 6 * D + i % 6 : rest / 9 * D + 6 + rest % 9;
    }
  }

  void gather(const turbomap::schur_system& s) {
    const turbomap::landmark_group_input couplings{
        {s.hpl.row.data(), s.hpl.row.size()}, {s.hpl.column.data(), s.hpl.column.size()}, nullptr, 1};
    gather_frames(s);
    const turbomap::frame_group_input pairs{{first_.data(), first_.size()}, {second_.data(), second_.size()}};
    builder_.build({frames_, landmarks_, {}, {&couplings, 1}, {&pairs, 1}, turbomap::observation_padding}, structure_);
    finder_.find(structure_);
    const auto& g = structure_.groups[0];
    rows_.assign(structure_.rows() * 9 + turbomap::column_slack, 0);
    couplings_.assign(structure_.couplings() * 3 * V + turbomap::column_slack, 0);
    for (const auto& c : g.chunks)
      for (int i = c.begin; i < c.begin + c.count; ++i) {
        const double* block = s.hpl.block(at(g.source[at(i)]));
        for (int v = 0; v < V; ++v)
          for (int m = 0; m < 3; ++m) couplings_[at(g.coupling[at(i)]) * 3 * V + at(m * V + v)] = block[v * 3 + m];
      }
    for (std::size_t k = 0; k < s.hll.block_count(); ++k) {  // all of it in the landmark's first row
      const auto l = at(s.hll.row[k]);
      const auto row = at(structure_.landmark_row[l]);
      if (structure_.landmark_row[l + 1] == structure_.landmark_row[l]) continue;
      const double* h = s.hll.block(k);
      const double lower[6] = {h[0], h[1], h[4], h[2], h[5], h[8]};
      std::copy(lower, lower + 6, rows_.begin() + static_cast<std::ptrdiff_t>(row * 9));
      for (std::size_t i = 0; i < 3; ++i) rows_[row * 9 + 6 + i] = s.bl[3 * l + i];
    }
  }

  /// Blocks of hpp on the diagonal of a frame, and squares between frames.
  void gather_frames(const turbomap::schur_system& s) {
    constexpr std::size_t triangle = turbomap::frame_block<D>::triangle;
    H_.assign(at(frames_) * triangle, 0), b_.assign(at(size()), 0);
    std::map<std::pair<int, int>, std::size_t> square;
    const std::size_t n = at(size());
    const auto dense = s.hpp.dense(true);
    for (std::size_t i = 0; i < n; ++i) {
      b_[at(ours_[i])] = s.bp[i];
      for (std::size_t j = 0; j < n; ++j) {
        const int r = ours_[i], c = ours_[j];
        if (dense[i * n + j] == 0 || r / D > c / D) continue;
        const int k = r % D, m = c % D;
        if (r / D == c / D) {
          if (k >= m) H_[at(r / D) * triangle + at(k * (k + 1) / 2 + m)] = dense[i * n + j];
          continue;
        }
        const auto [place, is_new] = square.emplace(std::pair(r / D, c / D), first_.size());
        if (is_new) {
          first_.push_back(r / D), second_.push_back(c / D);
          squares_.resize(first_.size() * D * D, 0.0);
        }
        squares_[place->second * D * D + at(k * D + m)] = dense[i * n + j];
      }
    }
  }

  void resident(const std::vector<double>& from, turbomap::array<double, memory>& to) {
    to.resize_discard(from.size());
    turbomap::copy_in(ctx_.policy(), to.data(), from.data(), from.size() * sizeof(double));
  }

  void send() {
    const auto& p = ctx_.policy();
    lists_.send_sums(p, structure_), lists_.send_blocks(p, structure_);
    lists_.point(view_);
    resident(rows_, sums_row_), resident(couplings_, sums_coupling_), resident(squares_, sums_square_);
    resident(H_, sums_H_), resident(b_, sums_b_);
    eliminated_.resize_discard(structure_.slots() * 3 * V + turbomap::column_slack),
        landmark_.resize_discard(at(landmarks_));
    view_.sums = {nullptr, sums_row_.data(), sums_coupling_.data(), nullptr, sums_square_.data()};
    view_.H = sums_H_.data(), view_.b = sums_b_.data();
    view_.eliminated = eliminated_.data(), view_.landmark = landmark_.data();
    view_.free_frames = frames_, view_.landmarks = landmarks_,
    view_.blocks = static_cast<int>(structure_.block_row.size());
  }

  turbomap::context<Policy>& ctx_;
  int frames_, landmarks_;
  std::vector<int> ours_;  ///< place of an unknown of the recording
  turbomap::structure_builder builder_;
  turbomap::adjustment_structure structure_;
  turbomap::block_finder finder_;
  turbomap::resident_structure<memory> lists_{ctx_.resource()};
  std::vector<double> rows_, couplings_, squares_, H_, b_;
  turbomap::array<double, memory> sums_row_{ctx_.resource()}, sums_coupling_{ctx_.resource()};
  turbomap::array<double, memory> sums_square_{ctx_.resource()};
  turbomap::array<double, memory> sums_H_{ctx_.resource()}, sums_b_{ctx_.resource()};
  turbomap::array<double, memory> eliminated_{ctx_.resource()};
  turbomap::array<turbomap::eliminated_landmark, memory> landmark_{ctx_.resource()};
  std::vector<std::int32_t> first_, second_;
  turbomap::schur_view<double> view_{};
};

}  // namespace turbomap_bundle
