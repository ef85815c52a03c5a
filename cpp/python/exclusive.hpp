#pragma once
#include <atomic>
#include <string>
#include <utility>

#include "proxcgal/error.hpp"

namespace proxcgal::binding {

/// An object that one thread uses at a time, although its calls let go of Python's lock.
template <class T>
class Exclusive : public T {
 public:
  using T::T;

 private:
  template <class>
  friend class Turn;
  mutable std::atomic_flag busy_ = ATOMIC_FLAG_INIT;
};

/// The use of such an object, for as long as this lives.
template <class T>
class Turn {
 public:
  /// @throws ProxError  another thread is using it
  Turn(const Exclusive<T>& object, const char* name) : busy_(object.busy_) {
    if (busy_.test_and_set(std::memory_order_acquire)) {
      throw ProxError(std::string(name) + " is in use by another thread: one " + name +
                      ", one thread at a time");
    }
  }
  ~Turn() { busy_.clear(std::memory_order_release); }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

 private:
  std::atomic_flag& busy_;
};

}  // namespace proxcgal::binding
