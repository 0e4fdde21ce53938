//! Low-latency mode of a serial driver: received bytes are delivered at once, not at a timer tick.
//!
//! Linux has a flag for it (`ASYNC_LOW_LATENCY`, `setserial(8)`): an FTDI adapter then waits 1 ms
//! instead of 16 ms for a full buffer. A pseudo-terminal has no such flag.
#![allow(unsafe_code, reason = "two ioctl calls that no crate wraps")]

use rustix::io::Errno;
use rustix::ioctl::{Getter, Setter, ioctl};
use serialport::TTYPort;
use std::os::fd::{AsRawFd, BorrowedFd};

const TIOCGSERIAL: u32 = 0x541E;
const TIOCSSERIAL: u32 = 0x541F;
const ASYNC_LOW_LATENCY: i32 = 1 << 13;

/// `struct serial_struct` of `linux/serial.h`.
#[repr(C)]
#[derive(Clone, Copy)]
struct SerialStruct {
    kind: i32,
    line: i32,
    port: u32,
    irq: i32,
    flags: i32,
    xmit_fifo_size: i32,
    custom_divisor: i32,
    baud_base: i32,
    close_delay: u16,
    io_type: u8,
    reserved: u8,
    hub6: i32,
    closing_wait: u16,
    closing_wait2: u16,
    iomem_base: usize,
    iomem_reg_shift: u16,
    port_high: u32,
    iomap_base: usize,
}

/// Sets the flag.
pub(super) fn request(port: &TTYPort) -> Result<(), Errno> {
    // SAFETY: `port` is borrowed until the end of this function, so its descriptor stays open.
    let fd = unsafe { BorrowedFd::borrow_raw(port.as_raw_fd()) };
    // SAFETY: TIOCGSERIAL fills one `serial_struct`; `SerialStruct` has the same layout.
    let mut serial = unsafe { ioctl(fd, Getter::<{ TIOCGSERIAL }, SerialStruct>::new()) }?;
    if serial.flags & ASYNC_LOW_LATENCY != 0 {
        return Ok(());
    }
    serial.flags |= ASYNC_LOW_LATENCY;
    // SAFETY: TIOCSSERIAL reads one `serial_struct`: the one just filled by the kernel, with one
    // more flag.
    unsafe { ioctl(fd, Setter::<{ TIOCSSERIAL }, SerialStruct>::new(serial)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pseudo_terminal_has_no_such_flag() {
        let (_master, slave) = TTYPort::pair().unwrap();
        assert_eq!(request(&slave), Err(Errno::NOTTY));
        // X-Val: linux/serial.h: sizeof(struct serial_struct) on 64-bit Linux.
        #[cfg(target_pointer_width = "64")]
        assert_eq!(size_of::<SerialStruct>(), 72);
    }
}
