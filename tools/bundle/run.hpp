// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// One run of turbomap-bundle under one policy: loads, adjusts, and makes the JSON of the contract.

#include <cmath>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <variant>

#include "arguments.hpp"
#include "load.hpp"
#include "schur_check.hpp"
#include "solve.hpp"

namespace turbomap_bundle {

/// Local windows are damped as SLAM systems do it, problems of other kinds as Ceres does it.
inline arguments with_damping(arguments a, const std::string& format) {
  if (a.damping.empty()) a.damping = format == "lba" ? "identity" : "diagonal";
  return a;
}

inline turbomap::adjustment_options options_of(const arguments& a) {
  turbomap::adjustment_options o;
  o.max_iterations = a.iterations, o.initial_lambda_scale = a.lambda_scale;
  o.damping = a.damping == "diagonal" ? turbomap::damping_rule::diagonal : turbomap::damping_rule::identity;
  using solver = turbomap::reduced_solver;
  o.solver = a.solver == "dense"    ? solver::dense
             : a.solver == "sparse" ? solver::sparse
             : a.solver == "pcg"    ? solver::pcg
                                    : solver::automatic;
  using turbomap::precision;
  o.numbers = a.precision == "mixed"     ? precision::mixed
              : a.precision == "float32" ? precision::float32
                                         : precision::float64;
  return o;
}

/// \param scale  what costs are multiplied by: BAL's are halves of sums of squares
template <class State>
nlohmann::json json_of(const solution<State>& s, double scale) {
  const auto& m = s.summary;
  nlohmann::json costs = nlohmann::json::array(), lambdas = nlohmann::json::array();
  int steps = 0, linear = 0;
  for (const auto& it : m.each) {
    costs.push_back(scale * it.cost), lambdas.push_back(it.lambda);
    steps += it.steps, linear += it.linear_iterations;
  }
  return {{"cost_initial", scale * m.cost_initial},
          {"cost_final", scale * m.cost_final},
          {"iterations", m.iterations},
          {"ms_per_iteration", s.ms_per_iteration()},
          {"ms_setup", s.ms_setup},
          {"ms_assign", s.ms_assign},
          {"ms_results", s.ms_results},
          {"ms_setup_first", s.ms_setup_first},
          {"ms_adjust", s.ms_adjust},
          {"cpu_ms_adjust", s.cpu_ms_adjust},
          {"peak_bytes", s.peak_bytes},
          {"end", turbomap::to_string(m.end)},
          {"accepted", m.accepted},
          {"undefined", m.undefined},
          {"steps", steps},
          {"linear_iterations", linear},
          {"costs", costs},
          {"lambdas", lambdas}};
}

template <class Policy>
struct adjust_loaded {
  const Policy& policy;
  const arguments& a;

  template <class Camera>
  nlohmann::json operator()(const rig_problem<Camera>& p) const {
    const auto options = options_of(a);
    const bool robust = a.kernel != "none";
    const auto s =
        solve_rig(policy, a.repeat, options, p, robust ? 5.991 : HUGE_VAL, robust ? 7.815 : HUGE_VAL, a.page_locked);
    auto json = json_of(s, 1);
    add_sizes(json, p.data.T_cw.size(), p.data.points.size(), p.data.observation_count());
    return json;
  }
  nlohmann::json operator()(const turbomap::bal_problem& p) const {
    refuse_page_locked();
    const auto options = options_of(a);
    const auto s = solve_bal(policy, a.repeat, options, p, a.kernel == "huber" ? 5.991 : HUGE_VAL);
    auto json = json_of(s, 0.5);
    add_sizes(json, p.cameras.size(), p.points.size(), p.pixel.size());
    return json;
  }
  nlohmann::json operator()(const turbomap::schur_system& s) const {
    refuse_page_locked();
    return check_schur(policy, s, a.repeat);
  }

 private:
  void refuse_page_locked() const {
    if (a.page_locked) throw std::invalid_argument("--page-locked: is for problems of reprojections, not for this one");
  }
  static void add_sizes(nlohmann::json& json, std::size_t frames, std::size_t landmarks, std::size_t observations) {
    json["frames"] = frames, json["landmarks"] = landmarks, json["observations"] = observations;
  }
};

/// Throws std::invalid_argument where it is said how a recorded linear system is to be adjusted: it is only checked.
inline void refuse_adjustment(const arguments& given) {
  const arguments usual;
  const auto refuse = [](const char* option, bool is_usual) {
    if (!is_usual) throw std::invalid_argument(std::string(option) + ": is for problems that are adjusted");
  };
  refuse("--solver", given.solver == usual.solver), refuse("--precision", given.precision == usual.precision);
  refuse("--kernel", given.kernel == usual.kernel), refuse("--damping", given.damping == usual.damping);
  refuse("--iterations", given.iterations == usual.iterations);
  refuse("--lambda-scale", given.lambda_scale == usual.lambda_scale);
}

/// Throws bad_file for an input that cannot be read, and std::invalid_argument for what would be ignored.
template <class Policy>
outcome run(const Policy& policy, const arguments& given) {
  const std::string format = given.format.empty() ? format_of(given.input) : given.format;
  if (format == "schur") refuse_adjustment(given);
  const arguments a = with_damping(given, format);
  outcome o;
  o.json = std::visit(adjust_loaded<Policy>{policy, a}, load(a, format));
  o.good = o.json.value("good", true);
  o.json["file"] = a.input.string(), o.json["format"] = format, o.json["policy"] = a.policy;
  o.json["solver"] = a.solver, o.json["precision"] = a.precision;
  o.json["damping_rule"] = a.damping;
  if (a.page_locked) o.json["page_locked"] = true;
  return o;
}

}  // namespace turbomap_bundle
