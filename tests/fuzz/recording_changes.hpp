// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The files of a recording or of another folder, and a few changes to them that a fuzzer's bytes describe. Most changes hit
/// numbers rather than headers, so that many recordings get past the first check.

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "fuzz.hpp"
#include "scenes/recording_samples.hpp"

namespace turbomap_fuzz {

/// A folder on disk, and what its files hold.
class folder_files {
 public:
  struct file {
    std::filesystem::path path;
    std::string content;
  };
  explicit folder_files(const std::filesystem::path& folder) : folder_(folder) {}
  const std::filesystem::path& folder() const { return folder_; }
  const std::vector<file>& files() const { return files_; }
  /// After files have been written.
  void read_files() {
    files_.clear();
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_))
      if (entry.is_regular_file()) files_.push_back({entry.path(), turbomap_test::file_bytes(entry.path())});
    std::sort(files_.begin(), files_.end(), [](const file& a, const file& b) { return a.path < b.path; });
  }

 private:
  std::filesystem::path folder_;
  std::vector<file> files_;
};

/// A good recording.
class recording_files : public folder_files {
 public:
  recording_files(const std::filesystem::path& folder, bool fisheye) : folder_files(folder) {
    turbomap::recording r = turbomap_test::small_recording(fisheye);
    r.sim_point_id.assign(r.kp_xy.size(), 0), r.sim_track_id.assign(r.kp_xy.size(), -1);  // every array is there
    r.sim_point_xyz = {{1, 2, 3}}, r.sim_point_normal = {{0, 0, -1}}, r.sim_T_cw_true = r.T_cw;
    r.sim_velocity_true = r.velocity, r.sim_bias_true = r.bias;
    turbomap::write_recording(folder, r);
    read_files();
  }
};

/// Changes files as long as it lives.
class recording_changes {
 public:
  recording_changes(const folder_files& files, bytes script) : files_(files), script_(script) {
    for (int i = 0; i < 6 && !script_.empty(); ++i) change();
    for (const std::size_t i : changed_)
      if (!removed_.count(i)) write(i, now_[i]);
    for (const std::size_t i : removed_) std::filesystem::remove(files_.files()[i].path);
  }
  ~recording_changes() {
    for (const std::size_t i : changed_) write(i, files_.files()[i].content);
  }
  recording_changes(const recording_changes&) = delete;
  recording_changes& operator=(const recording_changes&) = delete;

 private:
  unsigned next() {
    if (script_.empty()) return 0;
    const unsigned value = static_cast<unsigned char>(script_.front());
    script_.remove_prefix(1);
    return value;
  }
  void write(std::size_t i, const std::string& content) const {
    std::ofstream(files_.files()[i].path, std::ios::binary) << content;
  }

  void change() {
    const std::size_t i = next() % files_.files().size();
    if (now_.empty()) now_.resize(files_.files().size());
    if (changed_.insert(i).second) now_[i] = files_.files()[i].content;
    const unsigned what = next() % 10;
    const std::size_t at = next() + 256 * next();
    std::string& content = now_[i];
    if (content.empty()) return;
    if (files_.files()[i].path.extension() == ".json" && what < 8) return json_number(content, at);
    if (what < 5) return number(content, at);
    if (what == 5) return rows(content, at);
    if (what == 6) content[at % content.size()] = static_cast<char>(next());
    if (what == 7) content.resize(at % content.size());
    if (what == 8) content = files_.files()[next() % files_.files().size()].content;
    if (what == 9) removed_.insert(i);
  }
  static std::size_t data_begin(const std::string& npy) {
    return npy.size() < 10
               ? npy.size()
               : std::min<std::size_t>(npy.size(), 10 + static_cast<unsigned char>(npy[8]) +
                                                       256 * std::size_t(static_cast<unsigned char>(npy[9])));
  }
  /// Another number in the data: small, special, or any; in 1, 4 or 8 bytes.
  void number(std::string& content, std::size_t at) {
    const std::size_t begin = data_begin(content), size = content.size() - begin;
    const std::size_t width = std::size_t(1) << next() % 4;
    if (size < width) return;
    const double special[] = {0, 1, -1, 1e-300, 1e300, std::nan(""), HUGE_VAL, 1e38, 1e39, 0.5, 255};
    const unsigned kind = next() % 4;
    std::uint64_t bits = next();
    if (kind == 1) bits = ~bits;
    if (kind >= 2) {
      const double value = special[bits % std::size(special)];
      const auto single = static_cast<float>(value);
      bits = 0;
      if (width == 4) std::memcpy(&bits, &single, sizeof single);
      if (width == 8) std::memcpy(&bits, &value, sizeof value);
    }
    std::memcpy(&content[begin + at % (size / width) * width], &bits, width);
  }
  /// Another number of rows, in the header and in the data, which are the first row again and again.
  void rows(std::string& content, std::size_t at) {
    const std::size_t begin = data_begin(content), shape = content.find("'shape': (");
    if (shape == std::string::npos || shape + 12 > begin) return;
    const std::size_t digits = shape + 10;
    std::size_t end = digits;
    while (end < begin && content[end] >= '0' && content[end] <= '9') ++end;
    const std::size_t old = std::strtoul(content.c_str() + digits, nullptr, 10), now = at % 8;
    if (end == digits || old == 0) return;
    const std::string row = content.substr(begin, (content.size() - begin) / old);
    std::string number = std::to_string(now);
    number.resize(end - digits, ' ');
    content.replace(digits, end - digits, number);
    content.resize(begin);
    for (std::size_t k = 0; k < now; ++k) content += row;
  }
  /// Another number, or something else, in the place of a number of a JSON text.
  void json_number(std::string& content, std::size_t at) {
    static const char* const other[] = {"-1",
                                        "0",
                                        "0.5",
                                        "1.0000001",
                                        "1e39",
                                        "1e300",
                                        "1e400",
                                        "true",
                                        "null",
                                        "\"x\"",
                                        "[]",
                                        "{}",
                                        "255",
                                        "256",
                                        "2147483648",
                                        "-2147483649",
                                        "18446744073709551616",
                                        "1e-300"};
    std::vector<std::size_t> numbers;
    bool inside = false;
    for (std::size_t i = 0; i < content.size(); ++i) {
      const bool digit = (content[i] >= '0' && content[i] <= '9') || content[i] == '-';
      if (digit && !inside && i > 0 && content[i - 1] == ' ') numbers.push_back(i);
      inside = digit;
    }
    const char* const by = other[next() % std::size(other)];
    if (numbers.empty()) return;
    const std::size_t begin = numbers[at % numbers.size()];
    content.replace(begin, content.find_first_of(",\n]}", begin) - begin, by);
  }

  const folder_files& files_;
  bytes script_;
  std::vector<std::string> now_;
  std::set<std::size_t> changed_, removed_;
};

}  // namespace turbomap_fuzz
