// Time that other work on the machine does not lengthen: processor time of the threads that did the
// work.
#pragma once
#include <algorithm>
#include <ctime>
#include <thread>
#include <vector>

namespace glint::bench {

inline double seconds_of(clockid_t clock) {
  timespec now;
  clock_gettime(clock, &now);
  return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}
inline double wall_seconds() { return seconds_of(CLOCK_MONOTONIC); }
inline double process_seconds() { return seconds_of(CLOCK_PROCESS_CPUTIME_ID); }
inline double thread_seconds() { return seconds_of(CLOCK_THREAD_CPUTIME_ID); }

/// body(first, count) over [0, count), in equal shares (multiples of 64) on `threads` threads;
/// processor time of the busiest thread.
template <class Body>
double parallel_seconds(size_t count, int threads, Body body) {
  std::vector<double> taken(static_cast<size_t>(threads));
  const size_t share = (count / taken.size() + 63) / 64 * 64;
  auto work = [&](size_t k) {
    const double start = thread_seconds();
    const size_t first = std::min(count, k * share);
    if (first < count) body(first, std::min(share, count - first));
    taken[k] = thread_seconds() - start;
  };
  std::vector<std::thread> team;
  for (size_t k = 1; k < taken.size(); ++k) team.emplace_back(work, k);
  work(0);
  for (std::thread& thread : team) thread.join();
  return *std::max_element(taken.begin(), taken.end());
}

inline double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const size_t n = values.size();
  return n == 0 ? 0 : (values[(n - 1) / 2] + values[n / 2]) / 2;
}

}  // namespace glint::bench
