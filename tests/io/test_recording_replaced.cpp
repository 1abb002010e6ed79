// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// A recording that is written over another: whatever fails, and wherever the process is killed, one of the two is read.

#include <turbomap/io/recording.hpp>
#include <turbomap/io/recording_writer.hpp>

#include <csignal>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <doctest/doctest.h>

#include "scenes/recording_samples.hpp"
#include "support/files.hpp"

using turbomap_test::bad_file_message;
using turbomap_test::file_bytes;
using turbomap_test::has;
using turbomap_test::small_recording;
namespace fs = std::filesystem;

namespace {

/// Two recordings that differ in values, in rows and in which arrays they have.
turbomap::recording old_recording() { return small_recording(); }
turbomap::recording new_recording() {
  turbomap::recording r = small_recording();
  r.final_T_cw.clear(), r.final_alive.clear();
  for (auto& T : r.T_cw) T.ty = 42;
  r.imu_t_ns.push_back(r.imu_t_ns.back() + 1), r.imu.push_back(r.imu.back());
  r.meta.events[0].name = "another";
  return r;
}
/// What is in a recording, as one string: all arrays, and of meta.json what differs.
std::string contents(const turbomap::recording& r) {
  std::string all = r.meta.events.at(0).name;
  turbomap::visit_arrays(r, [&](const char* name, const auto& rows, turbomap::recording_rows, turbomap::presence) {
    all.append(name).append(std::to_string(rows.size()));
    all.append(reinterpret_cast<const char*>(rows.data()), rows.size() * sizeof(*rows.data()));
  });
  return all;
}
std::set<std::string> names(const fs::path& folder) {
  std::set<std::string> all;
  for (const auto& entry : fs::directory_iterator(folder)) all.insert(entry.path().filename().string());
  return all;
}

/// No file of this process can become longer; the program's limit is back at the end of the scope. It is how a full disk
/// looks to one who writes.
class file_size_limit {
 public:
  explicit file_size_limit(rlim_t bytes) : old_signal_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &old_);
    const rlimit now{bytes, old_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &now);
  }
  ~file_size_limit() {
    setrlimit(RLIMIT_FSIZE, &old_);
    std::signal(SIGXFSZ, old_signal_);
  }
  file_size_limit(const file_size_limit&) = delete;
  file_size_limit& operator=(const file_size_limit&) = delete;

 private:
  rlimit old_{};
  void (*old_signal_)(int);
};

}  // namespace

TEST_CASE("a recording is replaced as a whole; what does not belong to it stays") {
  const turbomap_test::temporary_directory folder;
  turbomap::write_recording(folder.path(), old_recording());
  fs::create_directory(folder / "snap_0001");
  turbomap_test::write_bytes(folder / "timing.csv", "iter\n");
  turbomap_test::write_bytes(folder / "notes.txt", "mine");
  turbomap::write_recording(folder.path(), new_recording());
  CHECK(contents(turbomap::read_recording(folder.path())) == contents(new_recording()));
  const auto there = names(folder.path());
  for (const char* name : {"snap_0001", "timing.csv", "notes.txt", "meta.json"}) CHECK(there.count(name) == 1);
  for (const char* name : {"final_Tcw.npy", "incoming", "incoming.part"}) CHECK(there.count(name) == 0);
}

TEST_CASE("a full disk leaves the recording that was there") {
  const std::string old = contents(old_recording());
  const auto message = [](const fs::path& folder, rlim_t bytes) {
    const auto next = new_recording();
    const file_size_limit full(bytes);
    return bad_file_message([&] { turbomap::write_recording(folder, next); });
  };
  const turbomap_test::temporary_directory folder;
  turbomap::write_recording(folder / "r", old_recording());
  const auto before = names(folder / "r");
  int failed = 0;
  for (rlim_t bytes = 0; bytes < 1500; bytes += 100) {  // at another file each time, meta.json among them
    CAPTURE(bytes);
    const std::string said = message(folder / "r", bytes);
    if (said == "nothing thrown") continue;
    ++failed;
    CHECK(has(said, "could not be written"));
    CHECK(contents(turbomap::read_recording(folder / "r")) == old);
    CHECK(names(folder / "r") == before);
    message(folder / "new", bytes);
    CHECK_FALSE(fs::exists(folder / "new"));
  }
  CHECK(failed > 5);
  CHECK(message(folder / "r", 1000000) == "nothing thrown");
  CHECK(contents(turbomap::read_recording(folder / "r")) == contents(new_recording()));
}

TEST_CASE("single files survive a full disk") {
  const turbomap_test::temporary_directory folder;
  const std::vector<float> some(3, 1), many(3000, 2);
  turbomap::write_npy_rows(folder / "a.npy", some);
  turbomap::write_recording_meta(folder / "meta.json", old_recording().meta);
  const std::string array = file_bytes(folder / "a.npy"), meta = file_bytes(folder / "meta.json");
  std::string array_said, meta_said;
  {
    const file_size_limit full(500);
    array_said = bad_file_message([&] { turbomap::write_npy_rows(folder / "a.npy", many); });
    const auto next = new_recording().meta;
    meta_said = bad_file_message([&] { turbomap::write_recording_meta(folder / "meta.json", next); });
  }
  CHECK(has(array_said, "array a: could not be written"));
  CHECK(has(meta_said, "meta.json: could not be written"));
  CHECK(file_bytes(folder / "a.npy") == array);
  CHECK(file_bytes(folder / "meta.json") == meta);
  CHECK(names(folder.path()).size() == 2);
}

TEST_CASE("a writer that stopped anywhere between two files leaves one recording, and the next writer tidies up") {
  const std::string old = contents(old_recording()), next = contents(new_recording());
  // What a writer makes in incoming: all files, empty ones for the arrays that go.
  const auto stopped_after = [&](const fs::path& folder, std::size_t moves, bool committed) {
    turbomap::write_recording(folder, old_recording());
    turbomap::write_recording(folder / "whole", new_recording());
    const fs::path incoming = folder / (committed ? "incoming" : "incoming.part");
    fs::rename(folder / "whole", incoming);
    for (const char* gone : {"final_Tcw.npy", "final_alive.npy"}) turbomap_test::write_bytes(incoming / gone, "");
    std::size_t done = 0;
    for (const auto& name : names(incoming)) {
      if (done++ == moves) break;
      if (fs::file_size(incoming / name) == 0) {
        fs::remove(folder / name), fs::remove(incoming / name);
      } else {
        fs::rename(incoming / name, folder / name);
      }
    }
  };
  for (std::size_t moves = 0; moves < 40; moves += 3) {
    CAPTURE(moves);
    const turbomap_test::temporary_directory folder;
    stopped_after(folder.path(), moves, true);
    CHECK(contents(turbomap::read_recording(folder.path())) == next);
    // A write that fails for want of room does not lose it either; one that succeeds replaces it.
    const auto first = old_recording();
    std::string said;
    {
      const file_size_limit full(0);
      said = bad_file_message([&] { turbomap::write_recording(folder.path(), first); });
    }
    CHECK(has(said, "could not be written"));
    CHECK(contents(turbomap::read_recording(folder.path())) == next);
    CHECK(names(folder.path()).count("incoming") == 0);
    turbomap::write_recording(folder.path(), first);
    CHECK(contents(turbomap::read_recording(folder.path())) == old);
  }
  const turbomap_test::temporary_directory folder;
  stopped_after(folder.path(), 0, false);  // killed before the step that counts
  CHECK(contents(turbomap::read_recording(folder.path())) == old);
  turbomap::write_recording(folder.path(), new_recording());
  CHECK(contents(turbomap::read_recording(folder.path())) == next);
  CHECK(names(folder.path()).count("incoming.part") == 0);
}

TEST_CASE("a process that is killed while it writes leaves a recording") {
  const turbomap::recording a = old_recording(), b = new_recording();
  const std::string old = contents(a), next = contents(b);
  const turbomap_test::temporary_directory folder;
  turbomap::write_recording(folder.path(), a);
  int killed = 0;
  for (unsigned i = 0; i < 40; ++i) {
    const pid_t child = fork();
    REQUIRE(child >= 0);
    if (child == 0) {
      for (;;) turbomap::write_recording(folder.path(), a), turbomap::write_recording(folder.path(), b);
    }
    usleep(2000 + 731 * i);
    kill(child, SIGKILL);
    int status = 0;
    waitpid(child, &status, 0);
    killed += WIFSIGNALED(status);
    const std::string found = contents(turbomap::read_recording(folder.path()));
    CHECK((found == old || found == next));
  }
  CHECK(killed == 40);
}
