// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// parallel.hpp under a CUDA policy: stream-ordered, nothing waits unless it says so.

#include <cstddef>
#include <vector>

#include "memory.cuh"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// f(i) for i in [0, n), a thread each.
template <class Function>
__global__ void __launch_bounds__(for_each_tuning::block_size) for_each_index_kernel(int n, Function f) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i < n) f(i);
}

namespace detail {

template <class T>
struct same_type {
  using type = T;
};

}  // namespace detail

#if CUDART_VERSION >= 11080
namespace detail {

/// Whether what runs of a kernel on the current device was compiled for compute capability 9.0 or later. Each thread asks once
/// per kernel and device: the run-time takes about as long to tell as to launch.
inline bool is_compiled_for_90(const void* kernel, const char* what) {
  struct answer {
    const void* kernel;
    int device;
    bool yes;
  };
  thread_local std::vector<answer> known;
  int device = 0;
  check_cuda(cudaGetDevice(&device), "current device");
  for (const answer& a : known)
    if (a.kernel == kernel && a.device == device) return a.yes;
  cudaFuncAttributes compiled{};
  check_cuda(cudaFuncGetAttributes(&compiled, kernel), what);
  known.push_back({kernel, device, compiled.ptxVersion >= 90});  // that of __CUDA_ARCH__
  return known.back().yes;
}

/// Launches with an attribute of devices of compute capability 9.0 and later. False: the kernel was compiled for others, and
/// nothing was launched.
template <class... Parameters>
bool launch_with_attribute(cudaStream_t stream, const char* what, std::size_t shared, void (*kernel)(Parameters...),
                           int blocks, int threads, const cudaLaunchAttribute& given, void** arguments) {
  if (!is_compiled_for_90(reinterpret_cast<const void*>(kernel), what)) return false;
  cudaLaunchAttribute attribute = given;
  cudaLaunchConfig_t config{};
  config.gridDim = dim3(static_cast<unsigned>(blocks));
  config.blockDim = dim3(static_cast<unsigned>(threads));
  config.dynamicSmemBytes = shared;
  config.stream = stream;
  config.attrs = &attribute;
  config.numAttrs = 1;
  check_cuda(cudaLaunchKernelExC(&config, reinterpret_cast<const void*>(kernel), arguments), what);
  return true;
}

}  // namespace detail
#endif

/// Launches a kernel in the stream of a policy: `blocks` blocks of `threads` threads; none where `blocks` is 0.
/// \param what    for the message of an error
/// \param shared  bytes of dynamic shared memory
template <class Derived, class... Parameters>
void launch_kernel_with(const thrust::cuda_cub::execution_policy<Derived>& policy, const char* what, std::size_t shared,
                        void (*kernel)(Parameters...), int blocks, int threads,
                        typename detail::same_type<Parameters>::type... arguments) {
  if (blocks <= 0) return;
  void* pointers[] = {static_cast<void*>(&arguments)...};
  // Not <<<>>>: its error would have to be asked for, and somebody else's (an event that is not ready) might be the answer.
  check_cuda(cudaLaunchKernel(reinterpret_cast<const void*>(kernel), dim3(static_cast<unsigned>(blocks)),
                              dim3(static_cast<unsigned>(threads)), pointers, shared, stream_of(policy)),
             what);
}
/// The same without dynamic shared memory.
template <class Derived, class... Parameters>
void launch_kernel(const thrust::cuda_cub::execution_policy<Derived>& policy, const char* what,
                   void (*kernel)(Parameters...), int blocks, int threads,
                   typename detail::same_type<Parameters>::type... arguments) {
  launch_kernel_with(policy, what, 0, kernel, blocks, threads, arguments...);
}

/// The first thing that a kernel for launch_early() does: waits until the kernels before it in the stream are done, and what they
/// wrote is seen. The next one may be brought to the device meanwhile.
__device__ inline void begin_early() {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  asm volatile("griddepcontrol.launch_dependents;");
  asm volatile("griddepcontrol.wait;" ::: "memory");
#endif
}

/// As launch_kernel_with(), of a kernel that calls begin_early(). Where the device can (compute capability 9.0), it is brought
/// there while the one before it in the stream still runs: between short kernels that takes as long as one of them.
template <class Derived, class... Parameters>
void launch_early(const thrust::cuda_cub::execution_policy<Derived>& policy, const char* what, std::size_t shared,
                  void (*kernel)(Parameters...), int blocks, int threads,
                  typename detail::same_type<Parameters>::type... arguments) {
  if (blocks <= 0) return;
#if CUDART_VERSION >= 11080
  void* pointers[] = {static_cast<void*>(&arguments)...};
  cudaLaunchAttribute early{};
  early.id = cudaLaunchAttributeProgrammaticStreamSerialization;
  early.val.programmaticStreamSerializationAllowed = 1;
  if (detail::launch_with_attribute(stream_of(policy), what, shared, kernel, blocks, threads, early, pointers)) return;
#endif
  launch_kernel_with(policy, what, shared, kernel, blocks, threads, arguments...);
}

/// f(i) for i in [0, n), a thread each, in any order; f is called on the device. Returns when the launch is enqueued; throws
/// device_error.
template <class Derived, class Function>
void for_each_index(const thrust::cuda_cub::execution_policy<Derived>& policy, int n, Function f) {
  if (n <= 0) return;
  constexpr int block = for_each_tuning::block_size;
  launch_kernel(policy, "launch of for_each_index", for_each_index_kernel<Function>, (n - 1) / block + 1, block, n, f);
}

/// Copies from the host in the order of the policy's stream; throws device_error.
template <class Derived>
void copy_in(const thrust::cuda_cub::execution_policy<Derived>& policy, void* destination, const void* source,
             std::size_t bytes) {
  if (bytes == 0) return;
  check_cuda(cudaMemcpyAsync(destination, source, bytes, cudaMemcpyHostToDevice, stream_of(policy)),
             "copy to the device");
}

/// Whether bytes of the host are page-locked, by the first and the last of them: of cuda_pinned_resource, cudaMallocHost() or
/// cudaHostRegister(). Asking takes less than a microsecond. Throws device_error.
template <class Derived>
bool is_page_locked(const thrust::cuda_cub::execution_policy<Derived>&, const void* bytes, std::size_t n) {
  const auto is_locked = [](const void* byte) {
    cudaPointerAttributes attributes{};
    check_cuda(cudaPointerGetAttributes(&attributes, byte), "attributes of host memory");
    return attributes.type == cudaMemoryTypeHost;
  };
  return n != 0 && is_locked(bytes) && is_locked(static_cast<const std::byte*>(bytes) + n - 1);
}

/// Copies to the host in the order of the policy's stream; done after synchronize(). Throws device_error.
template <class Derived>
void copy_out(const thrust::cuda_cub::execution_policy<Derived>& policy, void* destination, const void* source,
              std::size_t bytes) {
  if (bytes == 0) return;
  check_cuda(cudaMemcpyAsync(destination, source, bytes, cudaMemcpyDeviceToHost, stream_of(policy)),
             "copy from the device");
}

/// Sets bytes in the order of the policy's stream; throws device_error.
template <class Derived>
void fill_bytes(const thrust::cuda_cub::execution_policy<Derived>& policy, void* destination, unsigned char value,
                std::size_t bytes) {
  if (bytes == 0) return;
  check_cuda(cudaMemsetAsync(destination, value, bytes, stream_of(policy)), "fill of device memory");
}

/// Waits for the policy's stream; throws device_error, also for what failed before.
template <class Derived>
void synchronize(const thrust::cuda_cub::execution_policy<Derived>& policy) {
  check_cuda(cudaStreamSynchronize(stream_of(policy)), "wait for the stream");
}

TURBOMAP_END_NAMESPACE
