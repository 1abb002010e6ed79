# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# install, export, find_package(turbomap).
include(CMakePackageConfigHelpers)

set(turbomap_cmake_dir "${CMAKE_INSTALL_LIBDIR}/cmake/turbomap")
install(DIRECTORY "${PROJECT_SOURCE_DIR}/include/turbomap" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}"
        FILES_MATCHING PATTERN "*.hpp" PATTERN "*.cuh")
install(TARGETS turbomap EXPORT turbomapTargets)
install(EXPORT turbomapTargets NAMESPACE turbomap:: DESTINATION "${turbomap_cmake_dir}")
configure_package_config_file("${PROJECT_SOURCE_DIR}/cmake/turbomapConfig.cmake.in"
                              "${PROJECT_BINARY_DIR}/turbomapConfig.cmake" INSTALL_DESTINATION "${turbomap_cmake_dir}"
                              NO_SET_AND_CHECK_MACRO)
# Before 1.0 a minor version may change an interface.
write_basic_package_version_file("${PROJECT_BINARY_DIR}/turbomapConfigVersion.cmake" COMPATIBILITY SameMinorVersion
                                 ARCH_INDEPENDENT)
install(FILES "${PROJECT_BINARY_DIR}/turbomapConfig.cmake" "${PROJECT_BINARY_DIR}/turbomapConfigVersion.cmake"
              "${PROJECT_SOURCE_DIR}/cmake/turbomapThrust.cmake" "${PROJECT_SOURCE_DIR}/cmake/turbomapPrecompiled.cmake"
        DESTINATION "${turbomap_cmake_dir}")
install(DIRECTORY "${PROJECT_SOURCE_DIR}/cmake/precompiled" DESTINATION "${turbomap_cmake_dir}")
install(FILES "${PROJECT_SOURCE_DIR}/package.xml" DESTINATION "${CMAKE_INSTALL_DATADIR}/turbomap")
# CMAKE_INSTALL_DOCDIR is the parent's folder where the parent has asked for it first.
install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DATAROOTDIR}/doc/turbomap")
