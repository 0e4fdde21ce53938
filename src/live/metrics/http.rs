//! Minimal HTTP: one `GET` or `HEAD /metrics` per connection, bounded in time and size.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Maximum time to receive a request, and to send an answer.
const TIMEOUT: Duration = Duration::from_secs(2);
/// Maximum time to drain the request after the answer.
const DRAIN_TIME: Duration = Duration::from_millis(200);
/// Timeout of one read or write, after which the state is checked.
const STEP: Duration = Duration::from_millis(50);
/// Maximum bytes of a request's line and headers.
const MAX: usize = 8192;
/// Content type of Prometheus' text format.
const FORMAT: &str = "text/plain; version=0.0.4; charset=utf-8";

#[derive(Debug, Clone, Copy, PartialEq)]
enum Verdict {
    Page,
    BadRequest,
    NotFound,
    NotAllowed,
    TimedOut,
    TooLong,
}

/// Progress of a connection.
#[derive(Debug, Default)]
pub(super) struct State {
    has_requested: AtomicBool,
    is_over: AtomicBool,
}

impl State {
    /// Whether its request is complete.
    pub fn has_requested(&self) -> bool {
        self.has_requested.load(Ordering::Relaxed)
    }

    /// Whether it has been answered or abandoned.
    pub fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed)
    }

    /// Marks it as over.
    pub fn end(&self) {
        self.is_over.store(true, Ordering::Relaxed);
    }
}

/// Answers the request of a connection with a `page`. Ends soon after `state` is over.
pub(super) fn answer(
    mut stream: TcpStream,
    page: impl Fn() -> String,
    state: &State,
) -> io::Result<()> {
    // On some systems the stream inherits the listener's mode.
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(STEP))?;
    stream.set_write_timeout(Some(STEP))?;
    let Some((verdict, is_head)) = receive(&mut stream, state)? else {
        return Ok(());
    };
    state.has_requested.store(true, Ordering::Relaxed);
    let (head, body) = response(verdict, page);
    send(&mut stream, head.as_bytes(), state)?;
    if !is_head {
        send(&mut stream, body.as_bytes(), state)?;
    }
    stream.shutdown(Shutdown::Write)?;
    drain_request(&mut stream, state)
}

/// Whether an error is a timeout of a step.
fn is_pause(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), Interrupted | TimedOut | WouldBlock)
}

/// The status of the request, and whether it is HEAD; `None` if the connection is over.
fn receive(stream: &mut impl Read, state: &State) -> io::Result<Option<(Verdict, bool)>> {
    let end = Instant::now() + TIMEOUT;
    let mut head = Vec::new();
    let mut piece = [0; 1024];
    while !state.is_over() {
        let before = head.len();
        match stream.read(&mut piece) {
            Ok(0) => return Ok(None),
            Ok(count) => head.extend(piece.iter().take(count)),
            Err(error) if is_pause(&error) => {}
            Err(error) => return Err(error),
        }
        if is_whole(&head, before) {
            return Ok(Some((check(&head), head.starts_with(b"HEAD "))));
        }
        if head.len() > MAX {
            return Ok(Some((Verdict::TooLong, false)));
        }
        if Instant::now() >= end {
            return Ok(Some((Verdict::TimedOut, false)));
        }
    }
    Ok(None)
}

/// Whether the headers are complete within [`MAX`]. The first `before` bytes alone are incomplete.
fn is_whole(head: &[u8], before: usize) -> bool {
    let head = head.get(..MAX).unwrap_or(head);
    let new = head.get(before.saturating_sub(3)..).unwrap_or_default();
    let ends = |end: &[u8]| new.windows(end.len()).any(|piece| piece == end);
    ends(b"\r\n\r\n") || ends(b"\n\n")
}

fn check(head: &[u8]) -> Verdict {
    let line = head.split(|byte| *byte == b'\n').next().unwrap_or(head);
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    let Ok(line) = std::str::from_utf8(line) else {
        return Verdict::BadRequest;
    };
    let [method, target, version] = line.split(' ').collect::<Vec<_>>()[..] else {
        return Verdict::BadRequest;
    };
    let path = target.split('?').next();
    if !version.starts_with("HTTP/1.") || method.is_empty() || !target.starts_with('/') {
        Verdict::BadRequest
    } else if path != Some("/metrics") {
        Verdict::NotFound
    } else if !matches!(method, "GET" | "HEAD") {
        Verdict::NotAllowed
    } else {
        Verdict::Page
    }
}

/// Headers and body of the answer.
fn response(verdict: Verdict, page: impl Fn() -> String) -> (String, String) {
    let (status, more, body) = match verdict {
        Verdict::Page => ("200 OK", "", page()),
        Verdict::BadRequest => ("400 Bad Request", "", "not a request of HTTP/1.1\n".into()),
        Verdict::NotFound => ("404 Not Found", "", "request /metrics\n".into()),
        Verdict::NotAllowed => (
            "405 Method Not Allowed",
            "Allow: GET, HEAD\r\n",
            "use GET\n".into(),
        ),
        Verdict::TimedOut => (
            "408 Request Timeout",
            "",
            "send the request within 2 s\n".into(),
        ),
        Verdict::TooLong => (
            "431 Request Header Fields Too Large",
            "",
            "send at most 8 KiB\n".into(),
        ),
    };
    let kind = match verdict {
        Verdict::Page => FORMAT,
        _ => "text/plain; charset=utf-8",
    };
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\n{more}Connection: close\r\n\r\n",
        body.len()
    );
    (head, body)
}

/// Sends all bytes within [`TIMEOUT`], unless the connection ends before.
fn send(stream: &mut impl Write, mut rest: &[u8], state: &State) -> io::Result<()> {
    let end = Instant::now() + TIMEOUT;
    while !rest.is_empty() && !state.is_over() {
        match stream.write(rest) {
            Ok(count) => rest = rest.get(count..).unwrap_or_default(),
            Err(error) if is_pause(&error) => {}
            Err(error) => return Err(error),
        }
        if Instant::now() >= end {
            return Err(io::ErrorKind::TimedOut.into());
        }
    }
    Ok(())
}

/// Reads the rest of the request: closing with unread bytes would reset the connection.
fn drain_request(stream: &mut impl Read, state: &State) -> io::Result<()> {
    let end = Instant::now() + DRAIN_TIME;
    let mut piece = [0; 1024];
    while Instant::now() < end && !state.is_over() {
        match stream.read(&mut piece) {
            Ok(0) => break,
            Err(error) if !is_pause(&error) => return Err(error),
            _ => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::{MAX_CONNECTIONS, Metrics, Server, serve};

    fn server() -> Server {
        serve("0", vec![Metrics::default()]).unwrap()
    }

    fn connect(server: &Server) -> TcpStream {
        let stream = TcpStream::connect(server.address()).unwrap();
        // The test ends, whatever the server does.
        stream
            .set_read_timeout(Some(Duration::from_secs(20)))
            .unwrap();
        stream
    }

    fn send_request(server: &Server, request: &[u8]) -> String {
        let mut stream = connect(server);
        stream.write_all(request).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    #[test]
    fn the_metrics_come_as_prometheus_text() {
        let server = server();
        let request = b"GET /metrics HTTP/1.1\r\nHost: x\r\nAccept: */*\r\n\r\n";
        // Many in turn.
        for _ in 0..20 {
            let answer = send_request(&server, request);
            let (head, body) = answer.split_once("\r\n\r\n").unwrap();
            let mut lines = head.split("\r\n");
            assert_eq!(lines.next(), Some("HTTP/1.1 200 OK"));
            let lines: Vec<&str> = lines.collect();
            let length = format!("Content-Length: {}", body.len());
            assert!(lines.contains(&length.as_str()), "{head}");
            // X-Val: https://prometheus.io/docs/instrumenting/exposition_formats: the type of
            // version 0.0.4.
            let kind = "Content-Type: text/plain; version=0.0.4; charset=utf-8";
            assert!(lines.contains(&kind), "{head}");
            assert!(lines.contains(&"Connection: close"), "{head}");
            assert!(body.starts_with("# HELP "), "{body}");
        }
    }

    /// X-Val: RFC 9110, section 9.3.2: as of GET, without content.
    #[test]
    fn head_request_gets_the_headers_only() {
        let server = server();
        for (target, status) in [("/metrics", "200 OK"), ("/", "404 Not Found")] {
            let answer = send_request(
                &server,
                format!("HEAD {target} HTTP/1.1\r\n\r\n").as_bytes(),
            );
            let (head, body) = answer.split_once("\r\n\r\n").unwrap();
            assert!(
                head.starts_with(&format!("HTTP/1.1 {status}\r\n")),
                "{head}"
            );
            let mut lines = head.lines();
            let length = lines.find_map(|line| line.strip_prefix("Content-Length: "));
            assert!(length.unwrap().parse::<usize>().unwrap() > 0, "{head}");
            assert_eq!(body, "");
        }
    }

    #[test]
    fn other_requests_are_refused() {
        let server = server();
        for (request, status) in [
            ("GET / HTTP/1.1\r\n\r\n", "404"),
            ("GET /metrics/ HTTP/1.1\r\n\r\n", "404"),
            ("POST / HTTP/1.1\r\n\r\n", "404"),
            (
                "POST /metrics HTTP/1.1\r\nContent-Length: 3\r\n\r\nabc",
                "405",
            ),
            ("PUT /metrics HTTP/1.1\r\n\r\n", "405"),
            ("GET /metrics?a=b HTTP/1.0\r\n\r\n", "200"),
            ("GET /metrics HTTP/1.1\n\n", "200"),
            ("GET /metrics\r\n\r\n", "400"),
            ("GET  /metrics HTTP/1.1\r\n\r\n", "400"),
            ("GET /metrics HTTP/2\r\n\r\n", "400"),
            ("\r\n\r\n", "400"),
        ] {
            let answer = send_request(&server, request.as_bytes());
            let begins = format!("HTTP/1.1 {status} ");
            assert!(answer.starts_with(&begins), "{request:?}: {answer}");
        }
        let answer = send_request(&server, b"\xFF\xFE /metrics HTTP/1.1\r\n\r\n");
        assert!(answer.starts_with("HTTP/1.1 400 "), "{answer}");
        let answer = send_request(&server, b"PUT /metrics HTTP/1.1\r\n\r\n");
        assert!(answer.contains("\r\nAllow: GET, HEAD\r\n"), "{answer}");
    }

    #[test]
    fn too_long_request_is_refused() {
        let server = server();
        let long = "a".repeat(2 * MAX);
        for request in [
            format!("GET /{long}"),
            format!("GET /metrics HTTP/1.1\r\nX: {long}"),
        ] {
            let answer = send_request(&server, request.as_bytes());
            assert!(answer.starts_with("HTTP/1.1 431 "), "{answer}");
        }
    }

    /// A scrape replaces the oldest connection, which closes without an answer; the others time
    /// out.
    #[test]
    fn scrape_replaces_the_oldest_half_open_connections() {
        for idle in [40, 129, 500] {
            let server = server();
            let mut slow: Vec<TcpStream> = (0..idle).map(|_| connect(&server)).collect();
            for stream in &mut slow {
                // The first may have been closed already.
                let _ = stream.write_all(b"GET /metrics HTTP/1.1\r\nHost:");
            }
            let answer = send_request(&server, b"GET /metrics HTTP/1.1\r\n\r\n");
            assert!(answer.starts_with("HTTP/1.1 200 "), "{answer}");
            let answers = slow.into_iter().map(|mut stream| {
                let mut answer = Vec::new();
                // Closed or reset.
                let _ = stream.read_to_end(&mut answer);
                String::from_utf8(answer).unwrap()
            });
            let answers: Vec<String> = answers.collect();
            let first_open = idle - (MAX_CONNECTIONS - 1);
            for (at, answer) in answers.iter().enumerate() {
                let begins = if at < first_open { "" } else { "HTTP/1.1 408 " };
                assert!(answer.starts_with(begins), "{at} of {idle}: {answer}");
                assert_eq!(answer.is_empty(), begins.is_empty(), "{at} of {idle}");
            }
        }
    }

    #[test]
    fn server_ends_with_its_handle_despite_silent_clients() {
        let server = server();
        let mut silent = connect(&server);
        silent.write_all(b"GET").unwrap();
        let _second = connect(&server);
        // The bound is wide: the time depends on other load of the machine.
        let started = Instant::now();
        drop(server);
        assert!(started.elapsed() < Duration::from_secs(60));
        let mut answer = Vec::new();
        // Closed or reset, without an answer.
        let _ = silent.read_to_end(&mut answer);
        assert!(answer.is_empty());
    }

    /// A client that takes this many bytes at a time, or none.
    struct Client(usize);

    impl Write for Client {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            match self.0 {
                0 => Err(io::ErrorKind::WouldBlock.into()),
                max => Ok(max.min(bytes.len())),
            }
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn sending_an_answer_times_out() {
        let (go, stop) = (State::default(), State::default());
        stop.end();
        assert!(send(&mut Client(3), &[0; 100], &go).is_ok());
        let error = send(&mut Client(0), &[0; 100], &go).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
        assert!(send(&mut Client(0), &[0; 100], &stop).is_ok());
    }

    #[test]
    fn headers_must_end_within_the_limit() {
        let mut head = vec![b'a'; MAX - 4];
        head.extend(b"\r\n\r\n");
        // For any division into reads.
        for before in [0, MAX - 4, MAX - 1] {
            assert!(is_whole(&head, before), "{before}");
        }
        head.insert(0, b'a');
        assert!(!is_whole(&head, 0));
        for (head, whole) in [("", false), ("\r\n\r", false), ("\n\n", true)] {
            assert_eq!(is_whole(head.as_bytes(), 0), whole, "{head:?}");
        }
    }
}
