// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Arrays. The first byte says as what the rest is read. What is read can be written and read again.

#include <array>
#include <cstring>

#include <turbomap/io/recording_arrays.hpp>

#include "fuzz.hpp"

using namespace turbomap_fuzz;

namespace {

template <class T>
void array(const std::filesystem::path& file) {
  turbomap::npy_array<T> a;
  if (!reads([&] { a = turbomap::read_npy<T>(file); })) return;
  expect(turbomap::detail::element_count(a.shape, sizeof(T)) == a.values.size(), "the shape holds the values");
  turbomap::write_npy<T>(folder() / "w.npy", a.values, a.shape);
  const auto again = turbomap::read_npy<T>(folder() / "w.npy");
  expect(again.shape == a.shape, "the shape is read back");
  expect(a.values.empty() || std::memcmp(again.values.data(), a.values.data(), a.values.size() * sizeof(T)) == 0,
         "the values are read back");
}
template <class Row>
void rows(const std::filesystem::path& file) {
  std::vector<Row> a;
  if (!reads([&] { a = turbomap::read_npy_rows<Row>(file); })) return;
  turbomap::write_npy_rows(folder() / "w.npy", a);
  expect(turbomap::read_npy_rows<Row>(folder() / "w.npy").size() == a.size(), "the rows are read back");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto file = put("a.npy", {reinterpret_cast<const char*>(data) + 1, size - 1});
  using read = void (*)(const std::filesystem::path&);
  constexpr read readers[] = {array<float>,
                              array<double>,
                              array<std::int32_t>,
                              array<std::int64_t>,
                              array<std::uint32_t>,
                              array<std::uint8_t>,
                              array<std::int8_t>,
                              rows<float>,
                              rows<turbomap::vec3<float>>,
                              rows<turbomap::rigid_transform<float>>,
                              rows<turbomap::descriptor_bytes>,
                              rows<turbomap::imu_sample>,
                              rows<turbomap::keypoint_reference>};
  readers[data[0] % std::size(readers)](file);
  return 0;
}
