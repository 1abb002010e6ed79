// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A CUDA user: the same as consumer.cpp, computed on the device. Ends with 77 where there is none.

#include <turbomap/math/linear.hpp>
#include <turbomap/types.hpp>

__global__ void transform(turbomap::rigid_transform<double> pose, turbomap::vec3<double>* x) {
  *x = turbomap::to_isometry<double>(pose) * *x;
}

int main() {
  int devices = 0;
  if (cudaGetDeviceCount(&devices) != cudaSuccess || devices == 0) return 77;
  turbomap::rigid_transform<double> pose;
  pose.qz = 1, pose.qw = 0;
  turbomap::vec3<double> x{1, 2, 3};
  turbomap::vec3<double>* device = nullptr;
  if (cudaMalloc(&device, sizeof x) != cudaSuccess) return 1;
  cudaMemcpy(device, &x, sizeof x, cudaMemcpyHostToDevice);
  transform<<<1, 1>>>(pose, device);
  const bool ok = cudaMemcpy(&x, device, sizeof x, cudaMemcpyDeviceToHost) == cudaSuccess;
  cudaFree(device);
  return ok && x.x == -1 && x.y == -2 && x.z == 3 ? 0 : 1;
}
