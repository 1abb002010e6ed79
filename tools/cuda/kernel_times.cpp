// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Where the time of a whole run on a device goes: every kernel, copy and call of the CUDA run-time of an unchanged program, summed
/// up at its end. A library that the CUDA driver loads into the program, with CUPTI:
///
///     CUDA_INJECTION64_PATH=libturbomap-kernel-times.so turbomap-replay RECORDING --policy cuda
///
/// Of a program compiled with TURBOMAP_WITH_NVTX=1 there is a second table, by stage of local mapping; for it, set
/// NVTX_INJECTION64_PATH to libcupti.so. What is recorded costs about a microsecond per call.

#include <cupti.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <unordered_map>
#include <vector>

#include <cxxabi.h>

namespace {

#if CUPTI_API_VERSION >= 130000
using kernel_record = CUpti_ActivityKernel10;
#else
using kernel_record = CUpti_ActivityKernel9;
#endif
#if CUPTI_API_VERSION >= 26  // CUDA 12.8
using copy_record = CUpti_ActivityMemcpy6;
#else
using copy_record = CUpti_ActivityMemcpy5;
#endif

struct kernel_sum {
  std::uint64_t count = 0, ns = 0, longest = 0;
  unsigned registers = 0, blocks = 0, threads = 0, shared = 0, local = 0;
};
/// On the device, and on the host in calls of the run-time, by stage.
struct stage_sum {
  std::uint64_t ranges = 0, ns = 0;
  std::uint64_t kernels = 0, kernel_ns = 0, copies = 0, copy_ns = 0, copied = 0;
  std::uint64_t launches = 0, launch_ns = 0, copy_calls = 0, copy_call_ns = 0, waits = 0, wait_ns = 0, others = 0,
                other_ns = 0;
};
struct device_work {
  std::uint32_t correlation;
  std::uint64_t ns, bytes;
  bool kernel;
};
struct call {
  std::uint32_t correlation, id;
  std::uint64_t begin, end;
};
struct mark {
  std::uint64_t at;
  std::string name;  ///< empty: the end of a range
  std::uint32_t id;
};

std::map<std::string, kernel_sum> kernels;
std::vector<device_work> works;
std::vector<call> calls;
std::vector<mark> marks;

std::string readable(const char* symbol) {
  int status = 0;
  char* name = abi::__cxa_demangle(symbol, nullptr, nullptr, &status);
  std::string text = status == 0 ? name : symbol;
  std::free(name);
  for (const char* gone : {"void ", "turbomap::", "nvcc_base::", "detail::", "(anonymous namespace)::"})
    for (std::size_t at; (at = text.find(gone)) != std::string::npos;) text.erase(at, std::string(gone).size());
  return text.substr(0, text.find('('));
}

void note(CUpti_Activity* record) {
  switch (record->kind) {
    case CUPTI_ACTIVITY_KIND_CONCURRENT_KERNEL: {
      const auto& k = *reinterpret_cast<kernel_record*>(record);
      kernel_sum& sum = kernels[k.name];
      const std::uint64_t ns = k.end - k.start;
      ++sum.count, sum.ns += ns;
      if (ns > sum.longest) {
        sum.longest = ns;
        sum.registers = k.registersPerThread, sum.local = k.localMemoryPerThread;
        sum.blocks = static_cast<unsigned>(k.gridX * k.gridY * k.gridZ);
        sum.threads = static_cast<unsigned>(k.blockX * k.blockY * k.blockZ);
        sum.shared = static_cast<unsigned>(k.staticSharedMemory + k.dynamicSharedMemory);
      }
      works.push_back({k.correlationId, ns, 0, true});
      break;
    }
    case CUPTI_ACTIVITY_KIND_MEMCPY: {
      const auto& c = *reinterpret_cast<copy_record*>(record);
      kernel_sum& sum = kernels[c.copyKind == CUPTI_ACTIVITY_MEMCPY_KIND_HTOD   ? "copy to the device"
                                : c.copyKind == CUPTI_ACTIVITY_MEMCPY_KIND_DTOH ? "copy from the device"
                                                                                : "copy on the device"];
      ++sum.count, sum.ns += c.end - c.start;
      works.push_back({c.correlationId, c.end - c.start, c.bytes, false});
      break;
    }
    case CUPTI_ACTIVITY_KIND_MEMSET: {
      const auto& c = *reinterpret_cast<CUpti_ActivityMemset4*>(record);
      ++kernels["fill"].count, kernels["fill"].ns += c.end - c.start;
      works.push_back({c.correlationId, c.end - c.start, 0, true});
      break;
    }
    case CUPTI_ACTIVITY_KIND_RUNTIME: {
      const auto& c = *reinterpret_cast<CUpti_ActivityAPI*>(record);
      calls.push_back({c.correlationId, c.cbid, c.start, c.end});
      break;
    }
    case CUPTI_ACTIVITY_KIND_MARKER: {
      const auto& m = *reinterpret_cast<CUpti_ActivityMarker2*>(record);
      const bool begins = (m.flags & CUPTI_ACTIVITY_FLAG_MARKER_START) != 0;
      if (!begins && (m.flags & CUPTI_ACTIVITY_FLAG_MARKER_END) == 0) break;
      marks.push_back({m.timestamp, begins && m.name != nullptr ? m.name : "", m.id});
      break;
    }
    default:
      break;
  }
}

void CUPTIAPI give_buffer(std::uint8_t** buffer, std::size_t* size, std::size_t* records) {
  *size = std::size_t{8} << 20;
  *buffer = static_cast<std::uint8_t*>(std::aligned_alloc(8, *size));
  *records = 0;
}
void CUPTIAPI take_buffer(CUcontext, std::uint32_t, std::uint8_t* buffer, std::size_t, std::size_t valid) {
  CUpti_Activity* record = nullptr;
  while (cuptiActivityGetNextRecord(buffer, valid, &record) == CUPTI_SUCCESS) note(record);
  std::free(buffer);
}

/// The innermost range around a moment: ranges[i] holds from its begin to the begin of the next.
struct span_of_range {
  std::uint64_t begin;
  std::string name;
};

std::vector<span_of_range> innermost(std::map<std::string, stage_sum>& stages) {
  std::vector<span_of_range> spans{{0, "outside"}};
  std::vector<std::pair<std::uint32_t, std::string>> open;
  std::map<std::uint64_t, std::vector<const mark*>> ordered;
  for (const mark& m : marks) ordered[m.at].push_back(&m);
  std::uint64_t before = 0;
  for (const auto& at : ordered)
    for (const mark* m : at.second) {
      if (!open.empty()) stages[spans.back().name].ns += m->at - before;
      before = m->at;
      if (m->name.empty()) {
        if (!open.empty()) open.pop_back();
      } else {
        open.emplace_back(m->id, open.empty() ? m->name : open.back().second + "/" + m->name);
        ++stages[open.back().second].ranges;
      }
      spans.push_back({m->at, open.empty() ? "outside" : open.back().second});
    }
  return spans;
}

void print_kernels() {
  std::multimap<std::uint64_t, std::string> by_time;
  std::uint64_t all = 0;
  for (const auto& k : kernels) by_time.emplace(k.second.ns, k.first), all += k.second.ns;
  std::printf("\n%9s %8s %9s %9s %6s %5s %6s %7s %6s  %s\n", "ms", "count", "us mean", "us max", "blocks", "thr",
              "regs", "shared", "local", "kernel (shape: that of its longest run)");
  for (auto k = by_time.rbegin(); k != by_time.rend(); ++k) {
    const kernel_sum& s = kernels[k->second];
    std::printf("%9.3f %8llu %9.2f %9.2f %6u %5u %6u %7u %6u  %s\n", 1e-6 * static_cast<double>(s.ns),
                static_cast<unsigned long long>(s.count),
                1e-3 * static_cast<double>(s.ns) / static_cast<double>(s.count), 1e-3 * static_cast<double>(s.longest),
                s.blocks, s.threads, s.registers, s.shared, s.local, readable(k->second.c_str()).c_str());
  }
  std::printf("%9.3f in all\n", 1e-6 * static_cast<double>(all));
}

void print_stages() {
  std::map<std::string, stage_sum> stages;
  const std::vector<span_of_range> spans = innermost(stages);
  const auto at = [&](std::uint64_t t) -> const std::string& {
    std::size_t low = 0, high = spans.size();
    while (high - low > 1) (spans[(low + high) / 2].begin <= t ? low : high) = (low + high) / 2;
    return spans[low].name;
  };
  std::unordered_map<std::uint32_t, const std::string*> stage_of;
  for (const call& c : calls) {
    const std::string& name = at(c.begin);
    stage_of[c.correlation] = &name;
    const char* what = nullptr;
    cuptiGetCallbackName(CUPTI_CB_DOMAIN_RUNTIME_API, c.id, &what);
    const std::string text = what == nullptr ? "" : what;
    stage_sum& s = stages[name];
    const std::uint64_t ns = c.end - c.begin;
    if (text.find("Launch") != std::string::npos)
      ++s.launches, s.launch_ns += ns;
    else if (text.find("Synchronize") != std::string::npos)
      ++s.waits, s.wait_ns += ns;
    else if (text.find("Memcpy") != std::string::npos || text.find("Memset") != std::string::npos)
      ++s.copy_calls, s.copy_call_ns += ns;
    else
      ++s.others, s.other_ns += ns;
  }
  for (const device_work& w : works) {
    const auto found = stage_of.find(w.correlation);
    stage_sum& s = stages[found == stage_of.end() ? "outside" : *found->second];
    if (w.kernel)
      ++s.kernels, s.kernel_ns += w.ns;
    else
      ++s.copies, s.copy_ns += w.ns, s.copied += w.bytes;
  }
  std::printf(
      "\nsums over the run, in ms; a range without the ranges in it\n%9s %7s | %7s %9s | %7s %8s %8s | %7s %8s | %7s "
      "%8s | %6s %8s | %6s %8s  %s\n",
      "ms", "ranges", "kernels", "ms", "copies", "ms", "MB", "launch", "ms", "copy", "ms", "waits", "ms", "other", "ms",
      "range");
  for (const auto& e : stages) {
    const stage_sum& s = e.second;
    const auto ms = [](std::uint64_t ns) { return 1e-6 * static_cast<double>(ns); };
    const auto n = [](std::uint64_t x) { return static_cast<unsigned long long>(x); };
    std::printf(
        "%9.2f %7llu | %7llu %9.2f | %7llu %8.2f %8.2f | %7llu %8.2f | %7llu %8.2f | %6llu %8.2f | %6llu %8.2f  %s\n",
        ms(s.ns), n(s.ranges), n(s.kernels), ms(s.kernel_ns), n(s.copies), ms(s.copy_ns),
        1e-6 * static_cast<double>(s.copied), n(s.launches), ms(s.launch_ns), n(s.copy_calls), ms(s.copy_call_ns),
        n(s.waits), ms(s.wait_ns), n(s.others), ms(s.other_ns), e.first.c_str());
  }
}

void print_calls() {
  std::map<std::uint32_t, std::pair<std::uint64_t, std::uint64_t>> of;  // count, ns
  for (const call& c : calls) ++of[c.id].first, of[c.id].second += c.end - c.begin;
  std::printf("\n%9s %8s  call of the run-time\n", "ms", "count");
  for (const auto& c : of) {
    const char* what = nullptr;
    cuptiGetCallbackName(CUPTI_CB_DOMAIN_RUNTIME_API, c.first, &what);
    std::printf("%9.3f %8llu  %s\n", 1e-6 * static_cast<double>(c.second.second),
                static_cast<unsigned long long>(c.second.first), what == nullptr ? "" : what);
  }
}

void print_all() {
  cuptiActivityFlushAll(1);
  print_kernels();
  print_calls();
  print_stages();
  std::fflush(stdout);
}

}  // namespace

/// Called by the CUDA driver when it is loaded.
extern "C" int InitializeInjection() {
  cuptiActivityRegisterCallbacks(give_buffer, take_buffer);
  for (const CUpti_ActivityKind kind :
       {CUPTI_ACTIVITY_KIND_CONCURRENT_KERNEL, CUPTI_ACTIVITY_KIND_MEMCPY, CUPTI_ACTIVITY_KIND_MEMSET,
        CUPTI_ACTIVITY_KIND_RUNTIME, CUPTI_ACTIVITY_KIND_MARKER})
    if (cuptiActivityEnable(kind) != CUPTI_SUCCESS) std::fprintf(stderr, "kernel times: no records of kind %d\n", kind);
  std::atexit(print_all);
  return 1;
}
