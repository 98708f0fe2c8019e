// A few threads that share loops.
#pragma once
#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace glint {

/// As many threads as are wanted, up to 1024; for 0 one for each core.
int thread_count(uint32_t wanted);

/// Threads that live as long as the pool. Where the system refuses a thread the pool is smaller.
class ThreadPool {
 public:
  explicit ThreadPool(int threads);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  /// Calls body(0) … body(count - 1), in any order, on all threads of the pool and the caller's,
  /// and returns when all are done. The first exception skips the calls that have not begun and is
  /// thrown again here. Not to be called from inside `body`.
  void run(size_t count, const std::function<void(size_t)>& body);
  size_t size() const { return threads_.size() + 1; }

 private:
  void work();
  void drain();

  std::vector<std::thread> threads_;
  std::mutex mutex_;
  std::condition_variable wake_, idle_;
  const std::function<void(size_t)>* body_ = nullptr;
  size_t count_ = 0, busy_ = 0, round_ = 0;
  std::atomic<size_t> next_{0};
  std::exception_ptr error_;
  bool stop_ = false;
};

/// Calls body(0) … body(count - 1) on a pool, `chunk` of them at a time.
template <class Body>
void each_chunk(size_t count, size_t chunk, ThreadPool& pool, Body body) {
  pool.run((count + chunk - 1) / chunk, [&](size_t c) {
    for (size_t k = c * chunk; k < std::min(count, (c + 1) * chunk); ++k) body(k);
  });
}

}  // namespace glint
