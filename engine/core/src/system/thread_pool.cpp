#include "system/thread_pool.h"

#include <utility>

namespace glint {

int thread_count(uint32_t wanted) {
  const uint32_t cores = std::max(1u, std::thread::hardware_concurrency());
  return int(std::min(wanted ? wanted : cores, 1024u));
}

ThreadPool::ThreadPool(int threads) {
  if (threads > 1) threads_.reserve(size_t(threads - 1));
  for (int k = 1; k < threads; ++k) {
    try {
      threads_.emplace_back([this] { work(); });
    } catch (const std::exception&) {  // no thread, or no memory for one: as many as there are
      break;
    }
  }
}

ThreadPool::~ThreadPool() {
  {
    std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  for (auto& thread : threads_) thread.join();
}

void ThreadPool::run(size_t count, const std::function<void(size_t)>& body) {
  if (threads_.empty() || count <= 1) {
    for (size_t k = 0; k < count; ++k) body(k);
    return;
  }
  std::unique_lock lock(mutex_);
  body_ = &body;
  count_ = count;
  busy_ = threads_.size();
  ++round_;
  next_.store(0, std::memory_order_relaxed);
  lock.unlock();
  wake_.notify_all();
  drain();
  lock.lock();
  idle_.wait(lock, [this] { return busy_ == 0; });
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
}

void ThreadPool::work() {
  std::unique_lock lock(mutex_);
  for (size_t seen = 0;;) {
    wake_.wait(lock, [&] { return stop_ || round_ != seen; });
    if (stop_) return;
    seen = round_;
    lock.unlock();
    drain();
    lock.lock();
    if (--busy_ == 0) idle_.notify_one();
  }
}

void ThreadPool::drain() {
  try {
    for (size_t k; (k = next_.fetch_add(1, std::memory_order_relaxed)) < count_;) (*body_)(k);
  } catch (...) {
    next_.store(count_, std::memory_order_relaxed);
    std::lock_guard lock(mutex_);
    if (!error_) error_ = std::current_exception();
  }
}

}  // namespace glint
