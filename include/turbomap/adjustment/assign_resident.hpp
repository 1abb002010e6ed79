// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// bundle_problem::assign() under a policy that makes the lists of observations itself (order_observations.hpp): what was given
/// goes up as one block, indices first, so that they are put in order while the measurements follow. The host waits once.

#include <cstddef>
#include <cstdint>
#include <tuple>

#include "../config.hpp"
#include "../context.hpp"
#include "../packed_inputs.hpp"
#include "../plain_vector.hpp"
#include "factors.hpp"
#include "median_distance.hpp"
#include "order_observations.hpp"
#include "structure_builder.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Fills a part of a block and enqueues its copy. Much at once is not staged: pinned memory is scarce. Nor is a large array that
/// the caller has in page-locked memory: it is copied from where it is.
template <class Policy>
class block_sender {
 public:
  static constexpr std::size_t most_staged = std::size_t{1} << 26;
  /// Bytes from which on to begin a copy takes less than to stage them.
  static constexpr std::size_t least_borrowed = std::size_t{1} << 16;

  block_sender(context<Policy>& ctx, array<std::byte, memory_of_t<Policy>>& to, std::size_t bytes)
      : ctx_(ctx), staged_(bytes <= most_staged), block_{nullptr, nullptr} {
    if (staged_) {
      block_ = ctx.begin_upload(to, bytes);
    } else {
      to.resize_discard(bytes);
      block_.resident = to.data();
    }
  }
  block_sender(const block_sender&) = delete;
  block_sender& operator=(const block_sender&) = delete;
  /// After an exception the caller may free what is still being copied: waits.
  ~block_sender() {
    if (borrowed_) ctx_.settle();
  }
  /// Enqueues the copy of a large array from where it is, if that is page-locked. False: put() it in its turn.
  template <class T>
  bool borrow(const input_slot<T>& slot, const T* from) {
    const std::size_t bytes = slot.size * sizeof(T);
    if (bytes < least_borrowed || !is_page_locked(ctx_.policy(), from, bytes)) return false;
    borrowed_ = true;
    copy_in(ctx_.policy(), block_.resident + slot.at, from, bytes);
    return true;
  }
  /// The next part, in the order of places. \param sent  by borrow()
  template <class T>
  const T* put(const input_slot<T>& slot, const T* from, bool sent = false) {
    const std::size_t bytes = slot.size * sizeof(T);
    if (sent || borrow(slot, from)) {
      send();  // what was put before it
      begin_ = end_ = slot.at + bytes;
    } else if (staged_) {
      slot.copy(block_, from), end_ = slot.at + bytes;
    } else {
      borrowed_ = true;  // from page-locked memory a copy is under way on return
      copy_in(ctx_.policy(), block_.resident + slot.at, from, bytes);
    }
    return slot.size == 0 ? nullptr : slot.resident(block_);
  }
  /// Sends what was put since the last time.
  void send() {
    if (!staged_ || end_ <= begin_) return;
    ctx_.send({block_.host + begin_, block_.resident + begin_}, end_ - begin_);
    begin_ = end_;
  }
  /// The caller has waited for all copies.
  void arrived() { borrowed_ = false; }

 private:
  context<Policy>& ctx_;
  bool staged_, borrowed_ = false;
  upload_block block_;
  std::size_t begin_ = 0, end_ = 0;
};

/// A group of factors of frames that goes up in the block.
template <class Kept, class Slots, class Group>
struct sent_group {
  Kept& kept;
  Slots slots;
  const Group& given;
};
template <class Kept, class Slots, class Group>
sent_group(Kept&, Slots, const Group&) -> sent_group<Kept, Slots, Group>;

}  // namespace detail

/// What assign_resident() did.
struct resident_assignment {
  bool done;    ///< false: the host must make the lists
  bool finite;  ///< whether all numbers of rows and landmarks are: told by the policy, which looks at them anyway
};

/// Puts a problem where the policy computes: the numbers are sent as they were given, and the policy makes the lists of observations.
/// Where it cannot, the result says that the host must.
/// \param data     a problem_data whose first group is reprojections, the only one with landmarks; all were checked and described
/// \param builder  its frames are built here
/// \param rest     groups of factors of frames
template <class Policy, class Data, class Group, class... Rest>
resident_assignment assign_resident(context<Policy>& ctx, Data& data, structure_builder& builder,
                                    const structure_input& in, const frame_input<typename Data::frame>& frames,
                                    const landmark_input& landmarks, const Group& group, const Rest&... rest) {
  using Frame = typename Data::frame;
  using state = typename Frame::template state<double>;
  auto& kept = std::get<0>(data.groups);
  using camera = typename std::decay_t<decltype(kept.cameras())>::value_type;
  const auto& policy = ctx.policy();
  adjustment_structure& s = data.structure;
  builder.build_frames(in, s);
  const std::size_t rows = group.frame.size(), n = frames.states.size(), m = landmarks.positions.size();
  observation_input input{static_cast<int>(rows), s.frames, s.free_frames, s.landmarks, in.landmark_groups[0].kinds};
  if (!can_order_observations(policy, input)) return {false, true};
  data.hold(frames.held);
  data.order.keep(input.landmarks);

  // Room where the policy computes, before anything is enqueued. What is allocated later (scratch of the lists, vectors of the
  // host) may fail with work under way: the problem is empty then, and the next assign() waits first.
  const auto& masks = data.held.host();
  const std::size_t free = static_cast<std::size_t>(s.free_frames);
  packed_inputs inputs;
  const auto keys = inputs.place<std::int32_t>(n), frame_of_key = inputs.place<std::int32_t>(n);
  const auto kind = inputs.place<std::uint8_t>(rows), fixed = inputs.place<std::uint8_t>(landmarks.fixed.size());
  const auto row_frame = inputs.place<std::int32_t>(rows), row_landmark = inputs.place<std::int32_t>(rows);
  const auto free_of_frame = inputs.place<std::int32_t>(n), frame_factor = inputs.place<std::int32_t>(free + 1);
  const auto frame_factor_list = inputs.place<std::int32_t>(s.frame_factor_list.size());
  const auto frame_pair = inputs.place<std::int32_t>(free + 1);
  const auto neighbours = inputs.place<frame_neighbour>(s.neighbours.size());
  const auto held = inputs.place<std::uint32_t>(masks.size());
  const auto cameras = inputs.place<camera>(static_cast<std::size_t>(group.rig.count));
  const auto states = inputs.place<state>(n);
  const auto positions = inputs.place<vec3<double>>(m);
  // Each of the other groups, its places in the block and what was given for it.
  const auto of_rest = std::apply(
      [&](auto&, auto&... others) {
        return std::tuple{detail::sent_group{others, others.reserve(inputs, rest), rest}...};  // braces: in their order
      },
      data.groups);
  const bool measured_there = group.resident_pixel != nullptr && group.resident_information != nullptr;
  const auto information = inputs.place<double>(measured_there ? 0 : rows);
  const auto pixel = inputs.place<vec3<double>>(measured_there ? 0 : rows);
  detail::block_sender<Policy> block(ctx, data.inputs, inputs.bytes());
  observation_lists lists{};
  place_observations measurements{};
  data.lists.make_sums(input, lists);
  kept.make(group, static_cast<std::size_t>(input.most_chunks()), lists, measurements);
  data.estimate.resize(n, m);
  data.workspace.observations.resize_discard(1);
  ctx.begin_call();

  input.key_of_frame = block.put(keys, builder.keys().data());
  input.frame_of_key = block.put(frame_of_key, builder.frames_of_keys(s.frames).data());
  input.kind = block.put(kind, kept.kinds()), input.fixed = block.put(fixed, landmarks.fixed.data());
  input.frame = block.put(row_frame, group.frame.data());
  input.landmark = block.put(row_landmark, group.landmark.data());
  block.send();
  // What the caller has in page-locked memory is sent before kernels are launched: its copies take nothing of the host.
  const bool positions_sent = block.borrow(positions, landmarks.positions.data());
  const bool information_sent = block.borrow(information, group.information.data());
  const bool pixel_sent = block.borrow(pixel, group.pixel.data());
  observation_report* const report = launch_order_observations(policy, ctx.scratch(), input, lists);

  data.landmark_fixed.host().assign(landmarks.fixed.begin(), landmarks.fixed.end());
  data.landmark_fixed.adopt(input.fixed);
  const std::int32_t* const numbers = block.put(free_of_frame, s.free_of_frame.data());
  const std::int32_t* const partials_of_frame = block.put(frame_factor, s.frame_factor.data());
  const std::int32_t* const partials = block.put(frame_factor_list, s.frame_factor_list.data());
  const std::int32_t* const pairs_of_frame = block.put(frame_pair, s.frame_pair.data());
  data.lists.adopt(numbers, input.frame_of_key, partials_of_frame, partials, pairs_of_frame,
                   block.put(neighbours, s.neighbours.data()));
  data.held.adopt(block.put(held, masks.data()));
  kept.prepare_cameras(group, median_distance(in.landmark_groups, frames, landmarks));
  const camera* const prepared = block.put(cameras, kept.cameras().data());
  const place_estimate<Frame> estimate{block.put(states, frames.states.data()),
                                       block.put(positions, landmarks.positions.data(), positions_sent),
                                       s.frames,
                                       s.landmarks,
                                       data.estimate.current(),
                                       report};
  std::apply([&](const auto&... g) { (g.kept.put(block, g.slots, g.given), ...); }, of_rest);
  const double* const sent = block.put(information, group.information.data(), information_sent);
  block.send();
  launch_place_estimate(policy, estimate);
  const vec3<double>* const sent_pixel = block.put(pixel, group.pixel.data(), pixel_sent);
  block.send();
  measurements.information = measured_there ? group.resident_information : sent;
  measurements.pixel = measured_there ? group.resident_pixel : sent_pixel, measurements.report = report;
  launch_place_observations(policy, input.most_chunks() * observation_padding, measurements);
  observation_report& told = *data.workspace.observations.data();
  copy_out(policy, &told, report, sizeof told);
  ctx.synchronize();
  block.arrived();
  if (told.too_long != 0) return {false, true};
  s.sizes = told.sizes, s.partials = told.sizes.chunks, s.elsewhere = s.groups_elsewhere = true;
  kept.made(prepared, told.sizes.chunks);
  group_place place;
  place.landmark_group = 1, place.first_chunk = place.first_cost = s.partials;
  std::apply([&](const auto&... g) { (g.kept.enter(g.given, place), ...); }, of_rest);
  return {true, told.not_finite == 0};
}

TURBOMAP_END_NAMESPACE
