// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The one file that compiles the mapper.

#include "instantiated.hpp"

template class turbomap::local_mapper<my::map_type, my::policy>;
