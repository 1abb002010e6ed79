// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Work that is too large for the memory that it may use, done in pieces that fit. Tried as a whole first, so it costs nothing
/// where there is room.

#include <cstddef>

#include "../config.hpp"
#include "../error.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Calls work(begin, end) for consecutive ranges that make up [0, count). Where it throws out_of_memory, tries half of the range;
/// the pieces after it are as short.
/// \param work  when it throws, it has done nothing that it may not do again
/// \throws out_of_memory  a range of one does not fit
template <class Work>
void in_pieces(std::size_t count, Work work) {
  std::size_t size = count;
  for (std::size_t begin = 0; begin < count;) {
    const std::size_t end = count - begin < size ? count : begin + size;
    try {
      work(begin, end);
    } catch (const out_of_memory&) {
      if (end - begin <= 1) throw;
      size = (end - begin + 1) / 2;
      continue;
    }
    begin = end;
  }
}

TURBOMAP_END_NAMESPACE
