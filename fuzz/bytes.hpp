#pragma once
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "proxcgal/types.hpp"

/// What the fuzz targets share: input bytes read as the values that a harness asks for.
namespace proxcgal::fuzz {

/// Reads a fuzzer's bytes from front to back; behind the end everything is 0.
///
/// Most bytes give ordinary values, so that long sequences stay meaningful, and a few give what
/// code trips over: small changes of the input are small changes of the values.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  bool empty() const { return at_ >= size_; }
  std::uint8_t byte() { return empty() ? 0 : data_[at_++]; }
  bool one_in_eight() { return byte() >= 224; }
  int below(int n) { return byte() % n; }
  std::uint16_t word() {
    const auto high = static_cast<unsigned>(byte()) << 8U;
    return static_cast<std::uint16_t>(high | byte());
  }
  double between(double low, double high) { return low + (high - low) * (word() / 65535.0); }

  /// Any double at all: a value at the edge of something, or eight bytes as they are.
  double any() {
    const std::size_t which = byte();
    if (which < kEdges.size()) return kEdges[which];
    std::uint64_t bits = 0;
    for (int i = 0; i < 8; ++i) bits = bits << 8U | byte();
    return std::bit_cast<double>(bits);
  }
  double finite() {
    const double value = any();
    return value - value == 0.0 ? value : 0.0;
  }
  /// Inside the bounds but for one in eight.
  double mostly(double low, double high) { return one_in_eight() ? any() : between(low, high); }
  Vector3 vector(double half) {
    const double x = between(-half, half), y = between(-half, half);
    return {x, y, between(-half, half)};
  }

 private:
  using Double = std::numeric_limits<double>;
  static constexpr std::array kEdges = {0.0,
                                        -0.0,
                                        1.0,
                                        -1.0,
                                        Double::quiet_NaN(),
                                        Double::infinity(),
                                        -Double::infinity(),
                                        1e-12,
                                        -1e-9,
                                        1e-300,
                                        -1e300,
                                        Double::denorm_min(),
                                        Double::min(),
                                        Double::max(),
                                        1e9,
                                        -1e9,
                                        1e20,
                                        4.29e9,
                                        3.5,
                                        Double::lowest(),
                                        1e154};

  const std::uint8_t* data_;
  std::size_t size_;
  std::size_t at_ = 0;
};

}  // namespace proxcgal::fuzz
