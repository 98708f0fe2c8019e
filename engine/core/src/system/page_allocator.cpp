#include "system/page_allocator.h"

#include <cstdlib>
#include <new>

#if defined(__unix__) || defined(__APPLE__)
#include <sys/mman.h>
#endif

namespace glint {
namespace {

constexpr size_t kLarge = 1 << 20;
constexpr std::align_val_t kAlignment{64};

void* cleared(size_t bytes) {
  void* memory = std::calloc(bytes, 1);
  if (!memory) throw std::bad_alloc();
  return memory;
}

#if defined(__unix__) || defined(__APPLE__)

void* map(size_t bytes) {
  void* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
#ifdef MADV_HUGEPAGE
  madvise(memory, bytes,
          MADV_HUGEPAGE);  // fewer page faults, fewer misses of the address cache in traversal
#endif
  return memory;
}

#endif

}  // namespace

#if defined(__unix__) || defined(__APPLE__)

void* take_memory(size_t bytes) {
  return bytes < kLarge ? ::operator new(bytes, kAlignment) : map(bytes);
}
void* allocate_zeroed(size_t bytes) { return bytes < kLarge ? cleared(bytes) : map(bytes); }

void give_memory(void* memory, size_t bytes) noexcept {
  if (bytes < kLarge) return ::operator delete(memory, kAlignment);
  munmap(memory, bytes);
}

void free_zeroed(void* memory, size_t bytes) noexcept {
  if (bytes < kLarge) return std::free(memory);
  munmap(memory, bytes);
}

#else  // a heap that maps large blocks of its own accord

void* take_memory(size_t bytes) { return ::operator new(bytes, kAlignment); }
void give_memory(void* memory, size_t) noexcept { ::operator delete(memory, kAlignment); }
void* allocate_zeroed(size_t bytes) { return cleared(bytes); }
void free_zeroed(void* memory, size_t) noexcept { std::free(memory); }

#endif

}  // namespace glint
