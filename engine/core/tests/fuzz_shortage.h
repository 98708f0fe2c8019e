// Memory and threads that run out, for the code behind the C API.
#pragma once
#include <cstddef>

namespace glint::fuzz {

/// While it lives an allocation by `operator new`, or the start of a thread, is refused: the n-th,
/// and with `for_good` all after it. The core's threads count everywhere, the harness's only while
/// `Inside` lives. Where the core hides a C++ runtime of its own, its allocations are out of reach
/// and threads alone are refused; nothing is where there is no Linux.
class Shortage {
 public:
  Shortage(bool of_threads, size_t n, bool for_good);
  ~Shortage();
  Shortage(const Shortage&) = delete;
  Shortage& operator=(const Shortage&) = delete;
  /// Whether anything was.
  bool refused() const;
};

/// The harness's thread is in the core.
class Inside {
 public:
  Inside();
  ~Inside();
  Inside(const Inside&) = delete;
  Inside& operator=(const Inside&) = delete;
};

/// To be called on the harness's thread before any shortage.
void spare_this_thread();

}  // namespace glint::fuzz
