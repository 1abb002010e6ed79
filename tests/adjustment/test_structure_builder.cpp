// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The structure of a problem against one that is made by sorting and searching.

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <tuple>
#include <vector>

#include <turbomap/adjustment/structure.hpp>
#include <turbomap/adjustment/structure_builder.hpp>

namespace {

using turbomap::adjustment_structure;
using turbomap::observation_padding;
using indices = std::vector<std::int32_t>;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

struct group {
  indices frame, landmark;
  std::vector<std::uint8_t> kind;
  int kinds;
};

/// How the observations of a group come.
enum class order { any, by_landmark, by_landmark_and_frame };

struct problem {
  int frames, landmarks;
  std::vector<std::uint8_t> fixed;
  std::vector<group> groups;
  indices place;  ///< of landmarks; empty: as they are

  problem(int frame_count, int landmark_count, int rows, int group_count, order ordered, bool moved)
      : frames(frame_count), landmarks(landmark_count) {
    std::mt19937 random(static_cast<unsigned>(rows + frames));
    for (int f = 0; f < frames; ++f) fixed.push_back(random() % 4 == 0 ? 1 : 0);
    for (int g = 0; g < group_count; ++g) {
      std::vector<std::tuple<int, int, int>> all;  // a few are there twice: a rig may see a landmark with two cameras
      for (int r = 0; r < rows; ++r)
        all.emplace_back(random() % static_cast<unsigned>(landmarks), random() % static_cast<unsigned>(frames),
                         random() % 3);
      if (ordered == order::by_landmark)
        std::stable_sort(all.begin(), all.end(),
                         [](const auto& a, const auto& b) { return std::get<0>(a) < std::get<0>(b); });
      if (ordered == order::by_landmark_and_frame) std::sort(all.begin(), all.end());
      group made{{}, {}, {}, 3};
      for (const auto& [l, f, k] : all)
        made.landmark.push_back(l), made.frame.push_back(f), made.kind.push_back(static_cast<std::uint8_t>(k));
      if (g == 1) made.kind.clear(), made.kinds = 1;
      groups.push_back(made);
    }
    if (!moved) return;
    for (int l = 0; l < landmarks; ++l) place.push_back(l);
    std::shuffle(place.begin(), place.end(), random);
  }

  void build(turbomap::structure_builder& builder, int chunk, adjustment_structure& s) const {
    std::vector<turbomap::landmark_group_input> inputs;
    for (const group& g : groups)
      inputs.push_back({{g.frame.data(), g.frame.size()},
                        {g.landmark.data(), g.landmark.size()},
                        g.kind.empty() ? nullptr : g.kind.data(),
                        g.kinds});
    builder.build({frames,
                   landmarks,
                   {fixed.data(), fixed.size()},
                   {inputs.data(), inputs.size()},
                   {},
                   chunk,
                   {place.data(), place.size()}},
                  s);
  }
};

template <class List>
indices listed(const List& list) {
  return indices(list.begin(), list.end());
}

void check(const problem& p, int chunk, const adjustment_structure& s) {
  indices key(at(p.frames)), free_of_frame(at(p.frames), -1), frame_of_key;
  for (int f = 0; f < p.frames; ++f)
    if (p.fixed[at(f)] == 0) free_of_frame[at(f)] = static_cast<int>(frame_of_key.size()), frame_of_key.push_back(f);
  const int free = static_cast<int>(frame_of_key.size());
  for (int f = 0; f < p.frames; ++f)
    if (p.fixed[at(f)] != 0) frame_of_key.push_back(f);
  for (int k = 0; k < p.frames; ++k) key[at(frame_of_key[at(k)])] = k;
  CHECK(listed(s.free_of_frame) == free_of_frame);
  CHECK(s.free_frames == free);

  struct row {
    int landmark, key, group, source, kind, coupling;
  };
  std::vector<row> rows;
  for (std::size_t g = 0; g < p.groups.size(); ++g)
    for (std::size_t i = 0; i < p.groups[g].frame.size(); ++i)
      rows.push_back({p.place.empty() ? p.groups[g].landmark[i] : p.place[at(p.groups[g].landmark[i])],
                      key[at(p.groups[g].frame[i])], static_cast<int>(g), static_cast<int>(i),
                      p.groups[g].kind.empty() ? 0 : p.groups[g].kind[i], -1});
  std::stable_sort(rows.begin(), rows.end(), [](const row& a, const row& b) {
    return a.landmark != b.landmark ? a.landmark < b.landmark : a.key < b.key;
  });
  indices landmark_row(at(p.landmarks) + 1, 0), landmark_slot(at(p.landmarks) + 1, 0);
  indices slot_coupling, slot_frame, slot_landmark;
  int couplings = 0;
  for (row& r : rows) {
    for (int l = r.landmark; l < p.landmarks; ++l) ++landmark_row[at(l) + 1];
    if (r.key >= free) continue;
    if (slot_frame.empty() || slot_frame.back() != r.key || slot_landmark.back() != r.landmark) {
      slot_coupling.push_back(couplings), slot_frame.push_back(r.key), slot_landmark.push_back(r.landmark);
      for (int l = r.landmark; l < p.landmarks; ++l) ++landmark_slot[at(l) + 1];
    }
    r.coupling = couplings++;
  }
  slot_coupling.push_back(couplings);
  CHECK(listed(s.landmark_row) == landmark_row);
  CHECK(listed(s.landmark_slot) == landmark_slot);
  CHECK(listed(s.slot_coupling) == slot_coupling);
  CHECK(listed(s.slot_frame) == slot_frame);
  CHECK(listed(s.slot_landmark) == slot_landmark);
  indices frame_slot{0}, slot_list;
  for (int f = 0; f < free; ++f) {
    for (std::size_t i = 0; i < slot_frame.size(); ++i)
      if (slot_frame[i] == f) slot_list.push_back(static_cast<int>(i));
    frame_slot.push_back(static_cast<int>(slot_list.size()));
  }
  CHECK(listed(s.frame_slot) == frame_slot);
  CHECK(listed(s.slot_list) == slot_list);

  // Entries: what each chunk holds, in order.
  REQUIRE(s.groups.size() == p.groups.size());
  for (std::size_t g = 0; g < p.groups.size(); ++g) {
    std::vector<std::pair<row, int>> mine;  // and the number of the row
    for (std::size_t r = 0; r < rows.size(); ++r)
      if (rows[r].group == static_cast<int>(g)) mine.emplace_back(rows[r], static_cast<int>(r));
    std::stable_sort(mine.begin(), mine.end(), [](const auto& a, const auto& b) {
      return a.first.key != b.first.key ? a.first.key < b.first.key : a.first.kind < b.first.kind;
    });
    const auto& e = s.groups[g];
    std::size_t next = 0;
    bool same = true;
    for (const auto& c : e.chunks) {
      same = same && c.begin % observation_padding == 0 && c.count > 0 && c.count <= chunk;
      REQUIRE(next + at(c.count) <= mine.size());
      for (int i = c.begin; i < c.begin + c.count; ++i, ++next) {
        const auto& [r, number] = mine[next];
        same = same && c.frame == frame_of_key[at(r.key)] && c.free == (r.key < free ? r.key : -1) && c.kind == r.kind;
        same = same && e.source[at(i)] == r.source && e.landmark[at(i)] == r.landmark && e.row[at(i)] == number &&
               e.coupling[at(i)] == r.coupling;
      }
      for (int i = c.begin + c.count; i % observation_padding != 0; ++i)
        same = same && e.source[at(i)] == e.source[at(i - 1)] && e.coupling[at(i)] == e.coupling[at(i - 1)];
    }
    CHECK(same);
    CHECK(next == mine.size());
  }
  int partials = 0;
  indices of_frame, frame_partial{0};
  for (int f = 0; f < free; ++f) {
    partials = 0;
    for (const auto& e : s.groups)
      for (const auto& c : e.chunks) {
        if (c.free == f) of_frame.push_back(partials);
        ++partials;
      }
    frame_partial.push_back(static_cast<int>(of_frame.size()));
  }
  CHECK(listed(s.frame_partial) == frame_partial);
  CHECK(listed(s.partial_list) == of_frame);
}

TEST_CASE("rows, slots, entries and chunks: those of a plain sort, whatever the order and the problem before") {
  turbomap::structure_builder builder;
  adjustment_structure s;
  for (const auto ordered : {order::any, order::by_landmark, order::by_landmark_and_frame})
    for (const auto& [frames, landmarks, rows, groups] :
         {std::tuple{9, 40, 300, 1}, {30, 70, 900, 3}, {1, 1, 0, 1}, {5, 3, 700, 2}, {3, 1, 40, 1}, {12, 500, 200, 1}})
      for (const int chunk : {8, 64}) {
        const bool moved = chunk == 64 || groups == 3;
        const problem p(frames, landmarks, rows, groups, ordered, moved);
        const int order_number = static_cast<int>(ordered), row_number = rows;
        CAPTURE(order_number);
        CAPTURE(row_number);
        CAPTURE(chunk);
        p.build(builder, chunk, s);
        check(p, chunk, s);
      }
}

}  // namespace
