#include "fuzz_shortage.h"

#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <new>

#if defined(__linux__)
#include <dlfcn.h>
#include <pthread.h>

#include <cerrno>
#endif

namespace glint::fuzz {
namespace {

std::atomic<bool> is_on{false}, is_of_threads{false}, is_for_good{false};
std::atomic<int64_t> left{0}, refusals{0};
thread_local bool is_spared = false;

[[maybe_unused]] bool refuses(bool thread) {
  if (!is_on || is_of_threads != thread || is_spared) return false;
  const int64_t before = left--;
  const bool now = before == 0 || (before < 0 && is_for_good);
  if (now) ++refusals;
  return now;
}

}  // namespace

Shortage::Shortage(bool of_threads, size_t n, bool for_good) {
  is_of_threads = of_threads;
  is_for_good = for_good;
  left = int64_t(n);
  refusals = 0;
  is_on = true;
}

Shortage::~Shortage() { is_on = false; }
bool Shortage::refused() const { return refusals > 0; }

Inside::Inside() { is_spared = false; }
Inside::~Inside() { is_spared = true; }
void spare_this_thread() { is_spared = true; }

}  // namespace glint::fuzz

#if defined(__linux__)

namespace {

void* allocate(std::size_t size, std::size_t alignment) {
  if (glint::fuzz::refuses(false)) throw std::bad_alloc();
  const std::size_t rounded =
      (size + alignment) / alignment * alignment;  // one more than is needed at most, and never 0
  void* memory = alignment <= alignof(std::max_align_t) ? std::malloc(size ? size : 1)
                                                        : std::aligned_alloc(alignment, rounded);
  if (!memory) throw std::bad_alloc();
  return memory;
}

}  // namespace

void* operator new(std::size_t size) { return allocate(size, 1); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size, std::size_t(alignment));
}
/// Of std::stable_sort, which does without.
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  try {
    return allocate(size, 1);
  } catch (const std::bad_alloc&) {
    return nullptr;
  }
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, const std::nothrow_t&) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

extern "C" int pthread_create(pthread_t* thread, const pthread_attr_t* attributes,
                              void* (*body)(void*), void* argument) noexcept {
  using Create = int (*)(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*);
  static const Create next = reinterpret_cast<Create>(dlsym(RTLD_NEXT, "pthread_create"));
  return glint::fuzz::refuses(true) ? EAGAIN : next(thread, attributes, body, argument);
}

#endif
