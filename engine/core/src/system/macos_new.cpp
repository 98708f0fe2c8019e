// On macOS operators of the C++ library that is linked in would be shown to the whole process, and
// the loader would use one definition for all libraries. Here they are the core's own; an option of
// CMakeLists.txt hides them.
#if defined(__APPLE__)
#include <cstdlib>
#include <new>

namespace {

void* taken(std::size_t size) noexcept { return std::malloc(size ? size : 1); }

void* taken(std::size_t size, std::align_val_t alignment) noexcept {
  const auto multiple = static_cast<std::size_t>(alignment);
  void* memory = nullptr;
  const std::size_t least = multiple < sizeof(void*) ? sizeof(void*) : multiple;
  return posix_memalign(&memory, least, size ? size : 1) == 0 ? memory : nullptr;
}

void* checked(void* memory) {
  if (!memory) throw std::bad_alloc();
  return memory;
}

}  // namespace

using Size = std::size_t;
using Align = std::align_val_t;
using Quiet = std::nothrow_t;

void* operator new(Size n) { return checked(taken(n)); }
void* operator new[](Size n) { return checked(taken(n)); }
void* operator new(Size n, Align a) { return checked(taken(n, a)); }
void* operator new[](Size n, Align a) { return checked(taken(n, a)); }
void* operator new(Size n, const Quiet&) noexcept { return taken(n); }
void* operator new[](Size n, const Quiet&) noexcept { return taken(n); }
void* operator new(Size n, Align a, const Quiet&) noexcept { return taken(n, a); }
void* operator new[](Size n, Align a, const Quiet&) noexcept { return taken(n, a); }
void operator delete(void* p) noexcept { std::free(p); }
void operator delete[](void* p) noexcept { std::free(p); }
void operator delete(void* p, Size) noexcept { std::free(p); }
void operator delete[](void* p, Size) noexcept { std::free(p); }
void operator delete(void* p, Align) noexcept { std::free(p); }
void operator delete[](void* p, Align) noexcept { std::free(p); }
void operator delete(void* p, Size, Align) noexcept { std::free(p); }
void operator delete[](void* p, Size, Align) noexcept { std::free(p); }
void operator delete(void* p, const Quiet&) noexcept { std::free(p); }
void operator delete[](void* p, const Quiet&) noexcept { std::free(p); }
void operator delete(void* p, Align, const Quiet&) noexcept { std::free(p); }
void operator delete[](void* p, Align, const Quiet&) noexcept { std::free(p); }
#endif
